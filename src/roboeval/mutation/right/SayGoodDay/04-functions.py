# Greeting is a function.
def greet_if_there():
    if is_in_room("anybody"):
        say("Have a good day!")


def labs():
    return sorted(r for r in get_all_rooms() if "lab" in r.lower())


def task_program():
    for lab in labs():
        go_to(lab)
        greet_if_there()
