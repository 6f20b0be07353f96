# A loop over two names.
def task_program():
    start = get_current_location()
    joining = []
    for name in ["Alice", "Bob"]:
        go_to(name + "'s office")
        if is_in_room(name):
            if ask(name, "Would you like to join for lunch?", ["yes", "no"]) == "yes":
                say("We meet in the lobby in 5 minutes.")
                joining.append(name)
    go_to(start)
    if joining:
        say(" and ".join(joining) + " will join you for lunch.")
    else:
        say("Nobody is coming.")
