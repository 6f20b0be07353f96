"""Tries to change the robot's own list of rooms, and that of a look that is known."""
# tame: yes
def task_program():
    rooms = get_all_rooms()
    rooms.append("attic")
    rooms.reverse()
    again = get_all_rooms()
    again.clear()
    say(str(rooms) + str(get_all_rooms()))
