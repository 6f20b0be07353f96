# One comprehension asks for everything.
def task_program():
    back = get_current_location()
    go_to("Zarko's office")
    needed = ["cheese", "bread", "butter"]
    missing = [n for n in needed if ask("Zarko", "Is there " + n + "?", ["no", "yes"]) == "no"]
    go_to(back)
    say("Missing: " + (" and ".join(missing) if missing else "nothing") + ".")
