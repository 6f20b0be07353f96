# A generator of occupied labs.
def occupied_labs():
    for room in get_all_rooms():
        if "lab" in room:
            go_to(room)
            if is_in_room("somebody"):
                yield room


def task_program():
    for _ in occupied_labs():
        say("good day!")
