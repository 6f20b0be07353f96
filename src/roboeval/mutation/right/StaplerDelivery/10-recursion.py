# A recursion over the rooms, delivering on the way back.
def look_and_serve(rooms):
    if not rooms:
        return
    go_to(rooms[0])
    lacks = not is_in_room("stapler")
    look_and_serve(rooms[1:])
    if lacks:
        go_to("supply room")
        pick("stapler")
        go_to(rooms[0])
        place("stapler")


def task_program():
    look_and_serve([room for room in get_all_rooms() if "printer room" in room])
