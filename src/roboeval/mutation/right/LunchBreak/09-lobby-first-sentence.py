# The place and the time in two sentences.
def task_program():
    start = get_current_location()
    who = []
    go_to("Bob's office")
    if ask("Bob", "Will you join for lunch, Bob?", ["yes", "no"]) == "yes":
        say("Very good.")
        say("Come to the lobby, please; lunch is in 5 minutes.")
        who += ["Bob"]
    go_to("Alice's office")
    if ask("Alice", "Will you join for lunch, Alice?", ["yes", "no"]) == "yes":
        say("Very good.")
        say("Come to the lobby, please; lunch is in 5 minutes.")
        who += ["Alice"]
    go_to(start)
    say({0: "Nobody comes.", 1: "Your company will be {}.", 2: "Your company will be {} and {}."}[len(who)].format(*who))
