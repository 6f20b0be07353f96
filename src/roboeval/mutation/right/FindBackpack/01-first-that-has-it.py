# Stops at the first room that has it.
def task_program():
    start = get_current_location()
    for room in get_all_rooms():
        if "conference room" in room:
            go_to(room)
            if is_in_room("backpack"):
                pick("backpack")
                go_to(start)
                place("backpack")
                return
    go_to(start)
    say("I could not find your backpack in the conference rooms.")
