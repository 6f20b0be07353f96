# For over an endless counter, with a pause that grows.
import itertools
import time


def task_program():
    go_to("elevator")
    for attempt in itertools.count(1):
        if is_in_room("someone") and ask("someone", "Excuse me, do you want to take the tour?", ["no", "yes"]) == "yes":
            break
        time.sleep(min(attempt, 10))
    say("Welcome to our university.")
    say("Follow me to the conference room.")
    go_to("conference room")
    say("You have arrived.")
    say("Enjoy your visit.")
