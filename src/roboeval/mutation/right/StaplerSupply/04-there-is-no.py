# There is no stapler in ...; a dictionary of what was seen.
def task_program():
    me = get_current_location()
    seen = {}
    for room in sorted(get_all_rooms()):
        if "printer" in room:
            go_to(room)
            seen[room] = is_in_room("stapler")
    go_to(me)
    for room in seen:
        if not seen[room]:
            say("There is no stapler in " + room + ".")
