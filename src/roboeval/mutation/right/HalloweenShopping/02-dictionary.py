# Totals in a dictionary, a sentence for each candy.
def task_program():
    origin = get_current_location()
    total = {"chocolate": 0, "caramel": 0, "gummy": 0}
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("somebody"):
                for candy in total:
                    total[candy] += int(ask("somebody", f"How many pieces of {candy} would you like?", ["4", "3", "2", "1", "0"]))
    go_to(origin)
    for candy, n in total.items():
        say(f"{n} {candy}")
