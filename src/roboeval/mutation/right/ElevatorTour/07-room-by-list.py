# The rooms are looked up in the list of rooms.
import time


def room_called(words):
    for room in get_all_rooms():
        if words in room:
            return room
    return words


def task_program():
    elevator, goal = room_called("elevator"), room_called("conference room")
    go_to(elevator)
    guest = False
    while not guest:
        if is_in_room("visitor"):
            guest = ask("visitor", "May I ask whether you are here for the tour?", ["yes", "no"]) == "yes"
            continue_waiting = not guest
        else:
            continue_waiting = True
        if continue_waiting:
            time.sleep(2)
    say("Hello and welcome to our university!")
    say("Please, follow me!")
    go_to(goal)
    say("We have arrived, enjoy your visit!")
