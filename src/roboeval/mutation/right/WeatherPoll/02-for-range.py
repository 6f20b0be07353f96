# A for loop with a waiting loop in it.
import time


def task_program():
    home = get_current_location()
    go_to("main entrance")
    yes = 0
    for _ in range(10):
        while not is_in_room("someone"):
            time.sleep(5)
        answer = ask("someone", "Is it hot outside, yes or no?", ["Yes", "No"])
        if answer == "Yes":
            yes += 1
    go_to(home)
    say(str(yes / 10 * 100) + "% said that it is hot outside.")
