# Next over a lazy search.
def visited(rooms):
    for room in rooms:
        go_to(room)
        yield room


def task_program():
    start = get_current_location()
    rooms = (room for room in sorted(get_all_rooms(), reverse=True) if "conference room" in room)
    hit = next((room for room in visited(rooms) if is_in_room("my backpack")), None)
    if hit:
        pick("my backpack")
    go_to(start)
    if hit:
        place("my backpack")
    else:
        say("I looked into all conference rooms, and the backpack was in none of them.")
