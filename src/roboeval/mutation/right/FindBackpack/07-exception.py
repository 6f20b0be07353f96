# A search that ends by an exception of its own.
class Found(Exception):
    pass


def search():
    for room in get_all_rooms():
        if room.lower().startswith("conference"):
            go_to(room)
            if is_in_room("backpack"):
                raise Found(room)


def task_program():
    start = get_current_location()
    item = "backpack"
    try:
        search()
    except Found:
        pick(item)
        go_to(start)
        place(item)
    else:
        go_to(start)
        say("Your backpack is not in the conference rooms.")
