# A function that comes back only with the right visitor.
from time import sleep


def meet_visitor():
    go_to("elevator")
    while True:
        if is_in_room("person"):
            reply = ask("person", "Hello, are you here for the tour?", ["yes, I am", "no, I am not"])
            if reply.startswith("yes"):
                return
        sleep(10)


def lead():
    say("Welcome to the university! Please follow me!")
    go_to("conference room")


def farewell():
    say("We've arrived at the conference room. I hope you enjoy your visit!")


def task_program():
    meet_visitor()
    lead()
    farewell()
