# Bob before Alice, one sentence for each name.
def task_program():
    origin = get_current_location()
    names = []
    for name in ("Bob", "Alice"):
        go_to(f"{name}'s office")
        answer = ask(name, "Do you feel like lunch?", ["no", "yes"])
        if answer == "yes":
            say("Great! Lobby, 5 minutes.")
            names.append(name)
    go_to(origin)
    if len(names) == 0:
        say("Nobody wants to join you.")
    for name in names:
        say(name + " is going to join us.")
