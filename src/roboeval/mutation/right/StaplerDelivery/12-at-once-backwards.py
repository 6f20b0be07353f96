# Backwards and at once (as four of the five phrasings allow).
def task_program():
    item = "stapler"
    for room in sorted(get_all_rooms(), reverse=True):
        if "printer" in room:
            go_to(room)
            if is_in_room(item):
                continue
            go_to("supply room")
            pick(item)
            go_to(room)
            place(item)
            say("A new stapler for this room!")
