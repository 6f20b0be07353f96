# A queue of the rooms to serve.
from collections import deque


def task_program():
    todo = deque()
    for room in reversed(get_all_rooms()):
        if "printer room" in room:
            go_to(room)
            if not is_in_room("a stapler"):
                todo.append(room)
    while todo:
        room = todo.popleft()
        go_to("the supply room")
        pick("a stapler")
        go_to(room)
        place("a stapler")
