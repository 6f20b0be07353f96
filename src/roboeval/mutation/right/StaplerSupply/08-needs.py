# Needs a stapler; sets.
def task_program():
    start = get_current_location()
    rooms = {room for room in get_all_rooms() if "printer room" in room}
    stocked = set()
    for room in sorted(rooms):
        go_to(room)
        if is_in_room("stapler"):
            stocked.add(room)
    go_to(start)
    for room in sorted(rooms - stocked):
        say(f"{room} doesn't have a stapler.")
