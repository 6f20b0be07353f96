# Searching and fetching are functions.
def find(thing, rooms):
    for room in rooms:
        go_to(room)
        if is_in_room(thing):
            return room
    return None


def task_program():
    me = get_current_location()
    conference_rooms = [room for room in get_all_rooms() if "conference room" in room]
    where = find("backpack", conference_rooms)
    if where is None:
        go_to(me)
        say("No backpack in any conference room.")
        return
    pick("backpack")
    go_to(me)
    place("backpack")
    say(f"Your backpack was in {where}.")
