# Asks first, then offers three times.
def task_program():
    start = get_current_location()
    go_to("Jill's office")
    answer = ask("Jill", "Do you want to have lunch today?", ["yes", "no"])
    if answer == "yes":
        when = ask("Jill", "What time would you like to have lunch?", ["11:30", "12:00", "12:30"])
        go_to(start)
        say(f"Jill said yes, she will have lunch at {when}.")
    else:
        go_to(start)
        say("Jill said no.")
