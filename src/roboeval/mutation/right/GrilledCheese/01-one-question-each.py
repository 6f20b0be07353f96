# Bread, cheese and butter, one question for each, the missing ones in a list.
def task_program():
    start = get_current_location()
    missing = []
    go_to("Zarko's office")
    for item in ["bread", "cheese", "butter"]:
        if ask("Zarko", f"Do you have {item}?", ["yes", "no"]) == "no":
            missing.append(item)
    go_to(start)
    if missing:
        say("Zarko is missing: " + ", ".join(missing))
    else:
        say("Zarko has everything that a grilled cheese takes.")
