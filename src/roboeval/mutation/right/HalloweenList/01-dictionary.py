# A dictionary of counts, one sentence with all three.
def task_program():
    start = get_current_location()
    counts = {"chocolate": 0, "caramel": 0, "gummy": 0}
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("person"):
                candy = ask("person", "Which Halloween candy do you want?", ["chocolate", "caramel", "gummy"])
                counts[candy] += 1
    go_to(start)
    say(f"Buy {counts['chocolate']} chocolates, {counts['caramel']} caramels and {counts['gummy']} gummies.")
