# Delivering is a function.
def lacks_stapler(room):
    go_to(room)
    return not is_in_room("stapler")


def deliver(room):
    go_to("supply room")
    pick("stapler")
    go_to(room)
    place("stapler")


def task_program():
    for room in [room for room in get_all_rooms() if "printer" in room and lacks_stapler(room)]:
        deliver(room)
