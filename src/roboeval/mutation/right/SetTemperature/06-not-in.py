# Says so if Arjun is not in.
def task_program():
    start = get_current_location()
    go_to("Arjun's office")
    if is_in_room("Arjun"):
        if ask("Arjun", "Is it too warm or too cold for you, so do you want it colder or warmer?", ["colder", "warmer"]) == "colder":
            go_to(start)
            say("68 degrees")
        else:
            go_to(start)
            say("76 degrees")
    else:
        go_to(start)
        say("Arjun is not in his office.")
