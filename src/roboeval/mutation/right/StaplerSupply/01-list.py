# A list of the rooms that lack one.
def task_program():
    start = get_current_location()
    lacking = []
    for room in get_all_rooms():
        if "printer room" in room:
            go_to(room)
            if not is_in_room("stapler"):
                lacking.append(room)
    go_to(start)
    for room in lacking:
        say(f"{room} has no stapler")
