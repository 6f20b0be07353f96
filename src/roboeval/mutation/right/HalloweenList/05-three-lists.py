# A list of offices for each candy.
def task_program():
    begin = get_current_location()
    likes_chocolate, likes_caramel, likes_gummy = [], [], []
    for room in sorted(get_all_rooms()):
        if "office" in room:
            go_to(room)
            if is_in_room("someone"):
                likes = {"chocolate": likes_chocolate, "caramel": likes_caramel, "gummy": likes_gummy}
                likes[ask("someone", "Your favorite Halloween candy?", ["gummy", "caramel", "chocolate"])].append(room)
    go_to(begin)
    say(f"{len(likes_chocolate)} want chocolate.")
    say(f"{len(likes_caramel)} want caramel.")
    say(f"{len(likes_gummy)} want gummy.")
