# Half a degree is enough.
def task_program():
    me = get_current_location()
    go_to("Arjun's office")
    warm = ask("Arjun", "Hello! Warmer or colder?", ["warmer", "colder"]) == "warmer"
    go_to(me)
    say("Set it to " + ("73.5" if warm else "70.5") + " degrees.")
