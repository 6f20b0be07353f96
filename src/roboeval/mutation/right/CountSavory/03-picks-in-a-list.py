# Every pick kept in a list, counted at the end by a set.
def task_program():
    SAVORY = {"ham sandwich", "beef jerky"}
    SWEET = {"donut", "cupcake"}
    picks = []
    origin = get_current_location()
    for place_name in get_all_rooms():
        if "office" not in place_name:
            continue
        go_to(place_name)
        if is_in_room("person"):
            picks.append(ask("person", "Please choose a snack.", sorted(SAVORY | SWEET)))
    go_to(origin)
    say(f"Number of savory choices: {len([p for p in picks if p in SAVORY])}")
