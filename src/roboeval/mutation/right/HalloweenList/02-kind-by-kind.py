# One sentence for each kind, the kind before the number.
def task_program():
    home = get_current_location()
    kinds = ["gummy", "caramel", "chocolate"]
    wishes = []
    for room in reversed(get_all_rooms()):
        if room.endswith("office"):
            go_to(room)
            if is_in_room("somebody"):
                wishes.append(ask("somebody", "Chocolate, caramel or gummy for Halloween?", kinds))
    go_to(home)
    for kind in kinds:
        say(f"{kind}: {wishes.count(kind)}")
