# What was seen in a dictionary, delivered in the other order.
def task_program():
    printers = [room for room in get_all_rooms() if room.startswith("printer room")]
    has = {}
    for room in printers:
        go_to(room)
        has[room] = is_in_room("stapler")
    for room in reversed(printers):
        if not has[room]:
            go_to("supply room")
            pick("stapler")
            go_to(room)
            place("stapler")
