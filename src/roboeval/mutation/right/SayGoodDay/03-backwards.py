# The labs from the last to the first.
def task_program():
    for room in reversed(get_all_rooms()):
        if "lab" in room.split():
            go_to(room)
            if is_in_room("someone"):
                say("Good day!")
