# Looks whether the supply room still has one.
def task_program():
    missing = set()
    for room in get_all_rooms():
        if "printer room" in room:
            go_to(room)
            if not is_in_room("stapler"):
                missing.add(room)
    for room in sorted(missing):
        go_to("supply room")
        if not is_in_room("stapler"):
            say("The supply room has no stapler left.")
            return
        pick("stapler")
        go_to(room)
        place("stapler")
