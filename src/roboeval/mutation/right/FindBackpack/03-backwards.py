# The last conference room first, a flag in hand.
def task_program():
    origin = get_current_location()
    rooms = get_all_rooms()
    rooms.reverse()
    found = False
    for room in rooms:
        if not found and room.startswith("conference room"):
            go_to(room)
            found = is_in_room("backpack")
    if found:
        pick("backpack")
    go_to(origin)
    if found:
        place("backpack")
