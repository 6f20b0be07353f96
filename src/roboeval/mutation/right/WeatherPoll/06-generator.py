# A generator of answers, of which ten are taken.
from itertools import islice
from time import sleep


def answers():
    while True:
        if is_in_room("person"):
            yield ask("person", "May I ask you: is it hot outside?", ["Yes, it is", "No, it is not"])
        else:
            sleep(30)


def task_program():
    me = get_current_location()
    go_to("main entrance")
    ten = list(islice(answers(), 10))
    go_to(me)
    hot = len([a for a in ten if a.startswith("Yes")])
    say(f"I asked ten people, and {hot} of them said yes, that is {hot * 10} percent.")
