# Looks whether they are there, and waits for them.
import time


def wait_for(name):
    go_to(name + "'s office")
    while not is_in_room(name):
        time.sleep(30)


def task_program():
    wait_for("Sally")
    sally = ask("Sally", "Do you want to go to the cinema with Mark?", ["yes", "no"])
    wait_for("Mark")
    say("I asked Sally about the cinema, and she said " + sally + ".")
    if sally == "yes":
        mark = ask("Mark", "What time do you want to go?", ["4 pm", "5 pm", "6 pm"])
        wait_for("Sally")
        say("Mark wants to go at " + mark + ".")
