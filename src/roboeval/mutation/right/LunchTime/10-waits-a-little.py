# Waits a little if Jill is out, looks again.
import time


def task_program():
    start = get_current_location()
    go_to("Jill's office")
    tries = 0
    while not is_in_room("Jill") and tries < 5:
        time.sleep(60)
        tries += 1
    if tries == 5:
        result = "Jill was not there."
    elif ask("Jill", "Do you want to have lunch with us today?", ["yes", "no"]) == "yes":
        result = "Jill said yes to lunch at " + ask("Jill", "At noon, at half past twelve or at one?", ["12:00", "12:30", "1:00"]) + "."
    else:
        result = "Jill said no to lunch."
    go_to(start)
    say(result)
