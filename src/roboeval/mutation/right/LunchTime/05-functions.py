# Asking gives a pair, the report is made from it.
def ask_jill():
    if ask("Jill", "Are you free for lunch today?", ["Yes, I am", "No, I am not"]).startswith("No"):
        return False, ""
    return True, ask("Jill", "At what time would you like to eat?", ["12:00 PM", "12:30 PM", "1:00 PM", "1:30 PM"])


def task_program():
    me = get_current_location()
    go_to("Jill's office")
    accepted, when = ask_jill()
    go_to(me)
    if accepted:
        say(f"Yes, Jill will join you for lunch at {when}.")
    else:
        say("No, Jill will not join you for lunch.")
