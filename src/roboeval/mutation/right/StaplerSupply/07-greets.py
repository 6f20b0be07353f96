# Announces the report, then gives it.
def task_program():
    starting_point = get_current_location()
    results = []
    for room in get_all_rooms():
        if "printer room" in room:
            go_to(room)
            results.append((room, is_in_room("stapler")))
    go_to(starting_point)
    say("Hello, I am back.")
    for room, found in results:
        if not found:
            say(room + " lacks a stapler.")
