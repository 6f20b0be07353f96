# Says in the report that nobody comes, also if nobody was in.
def task_program():
    me = get_current_location()
    report = ""
    for person, office in {"Alice": "Alice's office", "Bob": "Bob's office"}.items():
        go_to(office)
        if not is_in_room(person):
            continue
        wants = ask(person, "Our colleague would like to have lunch with you. Will you come?", ["yes", "no"])
        if wants == "no":
            continue
        say("We are meeting in five minutes in the lobby.")
        report += person + " is joining. "
    go_to(me)
    say(report or "Nobody is coming.")
