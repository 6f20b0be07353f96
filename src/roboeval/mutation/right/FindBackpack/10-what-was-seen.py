# What was seen is kept in a dictionary; no further look once it is found.
def task_program():
    start = get_current_location()
    seen = {}
    for room in get_all_rooms():
        if "conference room" in room and True not in seen.values():
            go_to(room)
            seen[room] = is_in_room("backpack")
    holders = [room for room, there in seen.items() if there]
    if holders:
        go_to(holders[0])
        pick("backpack")
        go_to(start)
        place("backpack")
        say("There you go!")
    else:
        go_to(start)
        say("The backpack is not there.")
