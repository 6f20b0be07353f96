# Does not drive to the lab that it is in.
def task_program():
    for lab in filter(lambda name: "lab" in name, get_all_rooms()):
        if get_current_location() != lab:
            go_to(lab)
        if is_in_room("people"):
            say("A good day to everybody here!")
