# Says the name of the lab's owner after the greeting.
def task_program():
    labs = [room for room in get_all_rooms() if room.endswith("lab")]
    for lab in labs:
        go_to(lab)
        if is_in_room("somebody"):
            say("Good day to you in " + lab + "!")
