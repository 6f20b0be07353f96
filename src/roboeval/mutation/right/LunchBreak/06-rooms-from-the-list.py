# The two offices found in the list of rooms.
def task_program():
    start = get_current_location()
    accepted = []
    for room in get_all_rooms():
        if room.lower() in ("alice's office", "bob's office"):
            go_to(room)
            name = room.split("'")[0].capitalize()
            if is_in_room(name) and ask(name, "Are you up for lunch?", ["yes", "no"]) == "yes":
                say("Meet us in the lobby in 5 minutes!")
                accepted.append(name)
    go_to(start)
    if accepted:
        say("These people join you for lunch: " + ", ".join(accepted))
    else:
        say("No one is coming.")
