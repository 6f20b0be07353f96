# Looks again after picking it up, and announces itself before it puts it down.
def task_program():
    back_here = get_current_location()
    for room in get_all_rooms():
        if "conference room" not in room:
            continue
        go_to(room)
        if is_in_room("backpack"):
            pick("backpack")
            is_in_room("backpack")
            break
    else:
        go_to(back_here)
        say("I am sorry, there was no backpack.")
        return
    go_to(back_here)
    say("I am back with your backpack and put it down here.")
    place("backpack")
