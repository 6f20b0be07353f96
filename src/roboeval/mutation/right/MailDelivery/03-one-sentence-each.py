# The offices backwards, a sentence for each name.
def name_of(office):
    return office[:office.index("'s")].title()


def task_program():
    go_to("mail room")
    pick("bin")
    givers = []
    for room in get_all_rooms()[::-1]:
        if "office" in room:
            go_to(room)
            if is_in_room("person") and ask("person", "Do you have any mail?", ["no", "yes"]) == "yes":
                ask("person", "Would you kindly drop it into the bin?", ["It is in the bin"])
                givers.append(name_of(room))
    go_to("mail room")
    place("bin")
    for giver in givers:
        say(giver + " has given mail.")
    if not givers:
        say("There was no mail today.")
