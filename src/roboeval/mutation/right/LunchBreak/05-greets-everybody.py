# Greets before it asks, and is kind to those who decline.
def task_program():
    start = get_current_location()
    coming = {}
    for who in ["Alice", "Bob"]:
        go_to(who + "'s office")
        say("Hi " + who + "!")
        coming[who] = ask(who, "Would you like to join us for lunch?", ["yes", "no"])
        if coming[who] == "yes":
            say("Then let us meet in the lobby in 5 minutes.")
        else:
            say("What a pity. Have a nice day!")
    go_to(start)
    yes = [who for who in coming if coming[who] == "yes"]
    if not yes:
        say("I am afraid that nobody is coming.")
    else:
        say("Joining you: " + " and ".join(yes) + ".")
