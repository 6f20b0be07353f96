# The position of the answer decides.
def task_program():
    choices = ["colder", "warmer"]
    go_back_to = get_current_location()
    go_to("arjun's office")
    chosen = choices.index(ask("arjun", "would you like it colder or warmer?", choices))
    go_to(go_back_to)
    say("Arjun would be happy with " + str([70, 74][chosen]) + " degrees.")
