# A visit gives a dictionary, the dictionaries are added.
CANDIES = ("chocolate", "caramel", "gummy candy")


def visit(room):
    go_to(room)
    if not is_in_room("human"):
        return {}
    return {candy: int(ask("human", f"How much {candy} do you want for Halloween?", ["0", "1", "2", "3", "4"])) for candy in CANDIES}


def task_program():
    home = get_current_location()
    visits = [visit(room) for room in get_all_rooms() if "office" in room]
    go_to(home)
    parts = [f"{sum(v.get(candy, 0) for v in visits)} pieces of {candy}" for candy in CANDIES]
    say("In total: " + ", ".join(parts))
