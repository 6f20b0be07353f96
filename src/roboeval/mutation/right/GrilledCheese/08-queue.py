# A list that is worked off, what he has removed from what is needed.
def task_program():
    start = get_current_location()
    needed = ["bread", "cheese", "butter"]
    missing = list(needed)
    go_to("zarko's office")
    while needed:
        item = needed.pop()
        if ask("zarko", "do you have " + item, ["yes", "no"]) == "yes":
            missing.remove(item)
    go_to(start)
    say(f"{len(missing)} of the ingredients are missing" + (": " + ", ".join(missing) if missing else "") + ".")
