# An index and a list of flags.
def task_program():
    where_i_was = get_current_location()
    rooms = list(filter(lambda r: "printer room" in r, get_all_rooms()))
    flags = [False] * len(rooms)
    for i in range(len(rooms)):
        go_to(rooms[i])
        if is_in_room("stapler"):
            flags[i] = True
    go_to(where_i_was)
    for i in range(len(rooms)):
        if not flags[i]:
            say("The " + rooms[i] + " has no stapler.")
