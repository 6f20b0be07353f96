# The number cut out of the room's name.
def task_program():
    home = get_current_location()
    numbers = []
    for room in [r for r in get_all_rooms() if r.startswith("printer room")]:
        go_to(room)
        if is_in_room("stapler"):
            continue
        numbers.append(room.replace("printer room", "").strip())
    go_to(home)
    for number in numbers:
        say("Printer room " + number + " does not have a stapler.")
