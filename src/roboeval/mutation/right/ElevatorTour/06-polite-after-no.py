# Thanks whoever is not here for the tour, and waits longer.
import time


def task_program():
    go_to("elevator")
    while True:
        if is_in_room("person"):
            if ask("person", "Good morning! Here for the tour?", ["yes", "no"]) == "no":
                say("Thank you, sorry to bother you.")
                time.sleep(60)
            else:
                break
        else:
            time.sleep(1)
    say("Welcome to our university. Will you follow me, please?")
    go_to("conference room")
    say("We both have arrived. Have a nice day and enjoy your visit!")
