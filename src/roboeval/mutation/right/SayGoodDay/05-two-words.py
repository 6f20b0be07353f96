# Two sentences for whoever is in.
def task_program():
    rooms = get_all_rooms()
    while rooms:
        room = rooms.pop()
        if "lab" not in room:
            continue
        go_to(room)
        occupied = is_in_room("person")
        if occupied:
            say("Hello!")
            say("I wish you a good day.")
