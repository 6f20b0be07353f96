# Looks whether Zarko is there, and says so if he is not.
def task_program():
    start = get_current_location()
    go_to("Zarko's office")
    if not is_in_room("Zarko"):
        go_to(start)
        say("Zarko is not in his office, so I could not ask him.")
        return
    missing = set()
    for item in ["bread", "cheese", "butter"]:
        if ask("Zarko", "Do you happen to have some " + item + "?", ["yes", "no"]) != "yes":
            missing.add(item)
    go_to(start)
    if len(missing) > 0:
        say("We still need " + " and ".join(sorted(missing)) + " for the grilled cheese.")
    else:
        say("Zarko has got all the ingredients.")
