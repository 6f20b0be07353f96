# Fetches a stapler at once for each room that has none (as four of the five phrasings allow).
def task_program():
    for room in get_all_rooms():
        if "printer room" in room:
            go_to(room)
            if not is_in_room("stapler"):
                go_to("supply room")
                pick("stapler")
                go_to(room)
                place("stapler")
