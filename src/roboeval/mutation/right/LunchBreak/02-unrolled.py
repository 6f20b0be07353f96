# No loop, one branch for each outcome.
def task_program():
    home = get_current_location()
    go_to("Alice's office")
    alice = ask("Alice", "Do you want to go to lunch with us?", ["Yes", "No"]) == "Yes"
    if alice:
        say("Please be in the lobby in five minutes.")
    go_to("Bob's office")
    bob = ask("Bob", "Do you want to go to lunch with us?", ["Yes", "No"]) == "Yes"
    if bob:
        say("Please be in the lobby in five minutes.")
    go_to(home)
    if alice and bob:
        say("Alice and Bob are coming.")
    elif alice:
        say("Alice is coming.")
    elif bob:
        say("Bob is coming.")
    else:
        say("nobody is coming")
