# The words are a constant.
GREETING = "Good day"
MARK = "!"


def task_program():
    visited = set()
    for room in get_all_rooms():
        is_lab = room.find("lab") != -1
        if is_lab and room not in visited:
            visited.add(room)
            go_to(room)
            message = GREETING + MARK
            if is_in_room("person") is True:
                say(message)
