# Looks twice, and asks by saying in two sentences.
def task_program():
    go_to("mail room")
    pick("bin")
    yes = set()
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("person") or is_in_room("human"):
                response = ask("person", "Excuse me, is there mail that I may take along?", ["yes", "no"])
                if response == "yes":
                    say("Very well.")
                    say("The bin is here: put it in, please.")
                    yes.add(room)
    go_to("mail room")
    place("bin")
    say("Done. " + (", ".join(sorted(room.split("'")[0] for room in yes)) or "Nobody") + " gave mail.")
