# Looks around first if it stands in a conference room already.
def task_program():
    start = get_current_location()
    if "conference room" in start and is_in_room("backpack"):
        say("Your backpack is right here.")
        pick("backpack")
        place("backpack")
        return
    for room in get_all_rooms():
        if "conference room" in room and room != start:
            go_to(room)
            if is_in_room("backpack"):
                pick("backpack")
                go_to(start)
                place("backpack")
                return
    go_to(start)
    say("I could not find it.")
