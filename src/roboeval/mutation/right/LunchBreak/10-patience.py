# Waits a while for somebody who is not in the office, then gives up.
import time


def is_there(name):
    for _ in range(3):
        if is_in_room(name):
            return True
        time.sleep(20)
    return False


def task_program():
    start = get_current_location()
    positive = set()
    for name in ["Alice", "Bob"]:
        go_to(name + "'s office")
        if is_there(name) and "yes" == ask(name, "Lunch?", ["yes", "no"]):
            say("Lobby, in 5 minutes.")
            positive.add(name)
    go_to(start)
    if not positive:
        say("Nobody is coming.")
        return
    say("Those who join: " + ", ".join(sorted(positive)) + ".")
