# A plain loop over the rooms.
def task_program():
    for room in get_all_rooms():
        if "lab" in room:
            go_to(room)
            if is_in_room("person"):
                say("good day")
