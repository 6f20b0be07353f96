# Counts the questions up to ten.
import time


def task_program():
    start = get_current_location()
    go_to("main entrance")
    asked = 0
    hot = 0
    while asked < 10:
        if is_in_room("person"):
            if ask("person", "Is it hot outside?", ["yes", "no"]) == "yes":
                hot += 1
            asked += 1
        else:
            time.sleep(1)
    go_to(start)
    say(f"{hot * 10} percent of the people said yes.")
