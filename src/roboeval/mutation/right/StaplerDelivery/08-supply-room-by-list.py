# The supply room looked up in the list of rooms.
def task_program():
    rooms = get_all_rooms()
    supply = [room for room in rooms if "supply" in room][0]
    printer_rooms = [room for room in rooms if "printer" in room]
    needs = []
    i = 0
    while i < len(printer_rooms):
        go_to(printer_rooms[i])
        needs.append(not is_in_room("stapler"))
        i += 1
    for room, need in zip(printer_rooms, needs):
        if need:
            go_to(supply)
            pick("stapler")
            go_to(room)
            place("stapler")
