# Waiting for a person is a function.
from time import sleep


def next_person():
    while not is_in_room("anybody"):
        sleep(2)


def finds_it_hot():
    next_person()
    return ask("anybody", "Is it hot today?", ["yes", "no"]) == "yes"


def task_program():
    back = get_current_location()
    go_to("main entrance")
    percentage = sum(finds_it_hot() for _ in range(10)) * 10
    go_to(back)
    say(f"{percentage}%")
