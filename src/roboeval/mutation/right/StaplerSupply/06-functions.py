# Looking and telling are functions.
def printer_rooms():
    return [room for room in get_all_rooms() if "printer room" in room]


def has_stapler(room):
    go_to(room)
    return is_in_room("stapler")


def tell(room):
    say(f"I found no stapler in {room}.")


def task_program():
    back = get_current_location()
    lacking = [room for room in printer_rooms() if not has_stapler(room)]
    go_to(back)
    for room in lacking:
        tell(room)
