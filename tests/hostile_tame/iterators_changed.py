"""Changes what it goes through."""
# tame: yes
def task_program():
    rooms = get_all_rooms()
    for room in rooms:
        if len(rooms) < 9:
            rooms.append(room)
    say(str(len(rooms)))
    known = {"a": 1}
    for rooms[0] in known.items():
        known[rooms[0]] = 1
