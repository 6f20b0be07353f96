# An index over the list of labs.
def task_program():
    all_labs = []
    for name in get_all_rooms():
        if name.split(" ")[-1] == "lab":
            all_labs.append(name)
    for i in range(len(all_labs)):
        go_to(all_labs[i])
        if not is_in_room("visitor"):
            continue
        say("Good day, nice to see you!")
