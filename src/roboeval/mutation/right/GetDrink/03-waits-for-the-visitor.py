# Waits until the visitor is in the lobby.
import time


def task_program():
    go_to("lobby")
    while not is_in_room("visitor"):
        time.sleep(5)
    wanted = ask("visitor", "Which drink would you like: a bottle of water, a lemonade or an iced tea?",
                 ["a bottle of water", "a lemonade", "an iced tea"])
    go_to("kitchen")
    pick(wanted)
    go_to("lobby")
    place(wanted)
