# A pause after each answer, so that the next person can come.
import time


def task_program():
    start = get_current_location()
    go_to("the main entrance")
    results = {"yes": 0, "no": 0}
    while results["yes"] + results["no"] < 10:
        while True:
            if is_in_room("human"):
                break
            time.sleep(1)
        results[ask("human", "Hello! Is it hot out there?", ["yes", "no"])] += 1
        time.sleep(20)
    go_to(start)
    say("%.0f percent of them find it hot." % (results["yes"] / 10 * 100))
