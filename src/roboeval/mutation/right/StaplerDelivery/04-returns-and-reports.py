# Goes back to where it started and says what it has done.
def task_program():
    start = get_current_location()
    empty = []
    for room in get_all_rooms():
        if "printer room" in room:
            go_to(room)
            if is_in_room("stapler") is False:
                empty.append(room)
    for room in empty:
        go_to("supply room")
        pick("stapler")
        go_to(room)
        place("stapler")
    go_to(start)
    say(f"I have brought {len(empty)} staplers.")
