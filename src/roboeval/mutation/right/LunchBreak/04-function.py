# Inviting is a function that says whether it worked.
def invite(name):
    go_to(name + "'s office")
    accepted = ask(name, "Hello " + name + ", lunch today?", ["Yes, gladly", "No, sorry"]).startswith("Yes")
    if accepted:
        say("Wonderful, the meeting point is the lobby, 5 minutes from now.")
    return accepted


def task_program():
    start = get_current_location()
    guests = [name for name in ("Alice", "Bob") if invite(name)]
    go_to(start)
    say("Coming along: " + ", ".join(guests) if guests else "Nobody is coming along.")
