# All names first, those who gave picked out at the end.
def task_program():
    go_to("mail room")
    pick("bin")
    rooms = [room for room in get_all_rooms() if "office" in room]
    answers = []
    for room in rooms:
        go_to(room)
        answer = "no"
        if is_in_room("people"):
            answer = ask("people", "Do you want to send any mail?", ["yes", "no"])
            if answer == "yes":
                ask("people", "Please put your letters into the bin", ["ready"])
        answers.append(answer)
    go_to("mail room")
    place("bin")
    names = [room.split("'")[0].capitalize() for room, answer in zip(rooms, answers) if answer == "yes"]
    if not names:
        say("Nobody gave any mail.")
        return
    say("Who gave mail: " + ", ".join(names) + ".")
