# A sentence of its own when nobody wants a candy.
def task_program():
    start = get_current_location()
    wanted = []
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("people"):
                for candy in ("chocolates", "caramels", "gummies"):
                    number = ask("people", f"Between 0 and 4, how many {candy} do you want?", ["0", "1", "2", "3", "4"])
                    wanted.extend([candy] * int(number))
    go_to(start)
    for candy in ("chocolates", "caramels", "gummies"):
        n = wanted.count(candy)
        if n == 0:
            say(f"You need 0 {candy}.")
        elif n == 1:
            say(f"You need just 1 of the {candy}.")
        else:
            say(f"You need {n} {candy}.")
