# Looks once more whether the guest is there before it sets off.
import time


def task_program():
    go_to("elevator")
    while True:
        while not is_in_room("person"):
            time.sleep(0.5)
        tour = ask("person", "Are you here for the tour?", ["yes", "no"])
        if tour == "yes":
            if is_in_room("person"):
                break
        time.sleep(0.5)
    for sentence in ("Welcome to our university!", "Follow me, please!"):
        say(sentence)
    go_to("conference room")
    for sentence in ("We have arrived!", "I hope that you enjoy your visit!"):
        say(sentence)
