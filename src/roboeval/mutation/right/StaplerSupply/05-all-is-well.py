# Says so when no room lacks one.
def task_program():
    start = get_current_location()
    missing = []
    for room in get_all_rooms():
        if "printer room" in room:
            go_to(room)
            if not is_in_room("stapler"):
                missing.append(room)
    go_to(start)
    if not missing:
        say("All printer rooms have a stapler.")
    for room in missing:
        say("No stapler in " + room)
