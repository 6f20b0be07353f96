# Greets him and thanks him.
def task_program():
    origin = get_current_location()
    go_to("Arjun's office")
    say("Good afternoon, Arjun!")
    answer = ask("Arjun", "Would you like your office to be warmer or colder?", ["warmer, please", "colder, please"])
    say("Thank you.")
    degrees = 72
    if answer.startswith("warm"):
        degrees += 1
    else:
        degrees -= 1
    go_to(origin)
    say("The new setting is %d." % degrees)
