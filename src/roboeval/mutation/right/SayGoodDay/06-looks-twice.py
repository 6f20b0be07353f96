# Looks a second time before it leaves an empty lab.
import time


def task_program():
    for room in get_all_rooms():
        if "lab" in room:
            go_to(room)
            somebody = is_in_room("human")
            if not somebody:
                time.sleep(5)
                somebody = is_in_room("human")
            if somebody:
                say("Good day.")
