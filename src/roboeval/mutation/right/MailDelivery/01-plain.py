# A plain loop, the names from the offices.
def task_program():
    go_to("mail room")
    pick("bin")
    gave = []
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("person"):
                if ask("person", "Do you have mail to send?", ["yes", "no"]) == "yes":
                    ask("person", "Please put your mail into the bin.", ["done"])
                    gave.append(room.split("'")[0])
    go_to("mail room")
    place("bin")
    if gave:
        say("Mail was given by " + ", ".join(gave) + ".")
    else:
        say("Nobody gave mail.")
