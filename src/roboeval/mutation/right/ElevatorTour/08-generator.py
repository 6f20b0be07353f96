# A generator that yields the answers of the people at the elevator.
import time


def answers_at_the_elevator():
    while True:
        if is_in_room("human"):
            yield ask("human", "Do you want to join the tour?", ["Yes, please", "No, thanks"])
        time.sleep(4)


def task_program():
    go_to("the elevator")
    for answer in answers_at_the_elevator():
        if answer == "Yes, please":
            break
    say("Welcome to our university, dear visitor.")
    say("Follow me.")
    go_to("the conference room")
    say("Dear visitor, we have arrived. Enjoy your visit.")
