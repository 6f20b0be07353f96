# Asks them to put it into the bin by saying so.
def task_program():
    go_to("mail room")
    pick("mail bin")
    names = []
    for office in [r for r in get_all_rooms() if r.endswith("office")]:
        go_to(office)
        if not is_in_room("somebody"):
            continue
        answer = ask("somebody", "Hello! Is there any mail to collect?", ["Yes", "No"])
        if answer == "Yes":
            say("Please place it in the mail bin.")
            names.append(office.replace("'s office", "").capitalize())
    go_to("mail room")
    place("mail bin")
    say(" and ".join(names) + " gave me mail." if names else "No one had mail.")
