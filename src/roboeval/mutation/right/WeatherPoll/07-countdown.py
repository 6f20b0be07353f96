# Counts down from ten.
import time


def task_program():
    here = get_current_location()
    go_to("main entrance")
    remaining, positive = 10, 0
    while remaining > 0:
        somebody = is_in_room("person")
        if somebody:
            reply = ask("person", "Is it hot outside?", ["yes", "no"])
            positive += reply == "yes"
            remaining -= 1
        if not somebody:
            time.sleep(3)
    go_to(here)
    say("Percentage of people who said yes: " + format(positive / 10, ".0%"))
