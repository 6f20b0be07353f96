# A small state machine.
import time


def task_program():
    state = "waiting"
    go_to("elevator")
    while state != "leading":
        if state == "waiting":
            if is_in_room("anybody"):
                state = "asking"
            else:
                time.sleep(3)
        elif state == "asking":
            if ask("anybody", "Are you our guest for the tour of the university?", ["Yes", "No"]) == "Yes":
                state = "leading"
            else:
                time.sleep(30)
                state = "waiting"
    say("A warm welcome to our university!")
    say("Please follow me.")
    go_to("conference room")
    say("We have arrived.")
    say("I hope you will enjoy your visit!")
