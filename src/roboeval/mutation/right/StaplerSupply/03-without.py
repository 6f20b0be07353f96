# Is without a stapler; backwards.
def task_program():
    origin = get_current_location()
    without = []
    for room in get_all_rooms()[::-1]:
        if "printer room" in room:
            go_to(room)
            there = is_in_room("a stapler")
            if there == False:
                without.insert(0, room)
    go_to(origin)
    while without:
        say(without.pop(0).capitalize() + " is without a stapler.")
