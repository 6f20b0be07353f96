# Waits in a loop of its own for somebody, then asks, and begins again after a no.
import time


def task_program():
    go_to("elevator")
    while True:
        while not is_in_room("person"):
            time.sleep(1)
        answer = ask("person", "Are you here for the tour?", ["yes", "no"])
        if answer == "yes":
            break
        time.sleep(1)
    say("Welcome to our university!")
    say("Please follow me.")
    go_to("conference room")
    say("We have arrived. Enjoy your visit!")
