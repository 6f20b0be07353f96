# One sentence at the elevator and one in the conference room.
import time


def task_program():
    go_to("elevator")
    visitor_found = False
    while not visitor_found:
        if is_in_room("visitor"):
            visitor_found = ask("visitor", "Did you come for the tour?", ["Yes", "No"]) == "Yes"
        if not visitor_found:
            time.sleep(5)
    say("Welcome to our university, follow me please.")
    go_to("conference room")
    say("Here we are, we have arrived; I hope you enjoy your visit.")
