# Three degrees up or down.
def task_program():
    start = get_current_location()
    go_to("Arjun's office")
    answer = ask("Arjun", "Would you like it warmer or colder?", ["warmer", "colder"])
    go_to(start)
    if answer == "warmer":
        say("75")
    else:
        say("69")
