# Looks again before and after it puts the stapler down.
def task_program():
    rooms_without = []
    for r in get_all_rooms():
        if "printer room" not in r:
            continue
        go_to(r)
        if is_in_room("stapler"):
            continue
        rooms_without.append(r)
    for r in rooms_without:
        go_to("supply room")
        pick("stapler")
        go_to(r)
        is_in_room("stapler")
        place("stapler")
        is_in_room("stapler")
        say("Here is a stapler.")
