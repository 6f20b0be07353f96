# Looks for the bin first.
def task_program():
    go_to("mail room")
    if not is_in_room("bin"):
        say("There is no bin here.")
        return
    pick("bin")
    result = ""
    for room in get_all_rooms():
        if "office" not in room:
            continue
        go_to(room)
        if is_in_room("person"):
            if ask("person", "Do you have mail?", ["yes", "no"]) == "yes":
                ask("person", "Please put the mail in the bin!", ["ok"])
                result += " " + room.split("'")[0]
    go_to("mail room")
    place("bin")
    say("I got mail from" + result + "." if result else "I got no mail.")
