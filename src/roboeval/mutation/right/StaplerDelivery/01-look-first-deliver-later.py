# Looks into all rooms, then delivers.
def task_program():
    lacking = []
    for room in get_all_rooms():
        if "printer room" in room:
            go_to(room)
            if not is_in_room("stapler"):
                lacking.append(room)
    for room in lacking:
        go_to("supply room")
        pick("stapler")
        go_to(room)
        place("stapler")
