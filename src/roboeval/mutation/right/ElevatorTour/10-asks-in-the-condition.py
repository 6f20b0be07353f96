# The question stands in the condition of the loop.
import time


def task_program():
    go_to("elevator")
    while not (is_in_room("someone") and ask("someone", "Is it the tour that brings you here?", ["yes", "no"]) == "yes"):
        time.sleep(15)
    say("Great! Welcome to our university, and please follow me to the conference room.")
    go_to("conference room")
    say("This is the conference room, so we have arrived. Please enjoy your visit!")
