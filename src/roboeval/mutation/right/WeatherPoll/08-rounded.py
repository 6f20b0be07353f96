# The share rounded to a whole number, in a longer report.
import time

PEOPLE = 10


def task_program():
    starting_location = get_current_location()
    go_to("main entrance")
    n_yes = 0
    for i in range(PEOPLE):
        present = is_in_room("visitor")
        while not present:
            time.sleep(60)
            present = is_in_room("visitor")
        if ask("visitor", "Would you say that it is hot outside?", ["yes", "no"]) != "no":
            n_yes += 1
    go_to(starting_location)
    say("I am back from the main entrance.")
    say(f"{round(100 * n_yes / PEOPLE)} percent say that it is hot.")
