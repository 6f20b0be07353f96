# Looks also after each question.
import time


def task_program():
    start = get_current_location()
    go_to("main entrance")
    yes_count = 0
    count = 0
    while count != 10:
        if is_in_room("people"):
            choice = ask("people", "Hot outside, yes or no?", ["yes", "no"])
            count += 1
            if choice == "yes":
                yes_count += 1
            is_in_room("people")
        time.sleep(1)
    go_to(start)
    say(f"Exactly {yes_count}0 % of the people I asked think it is hot." if yes_count else "0 % of the people I asked think it is hot.")
