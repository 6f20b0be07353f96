# The name of the candy before its number.
def how_many(what):
    return int(ask("someone", "How many " + what + "?", [str(n) for n in range(5)]))


def task_program():
    start = get_current_location()
    wishes = []
    for room in get_all_rooms():
        if "office" not in room:
            continue
        go_to(room)
        if is_in_room("someone"):
            wishes.append((how_many("chocolates"), how_many("caramels"), how_many("gummies")))
    go_to(start)
    chocolate, caramel, gummy = (sum(column) for column in zip(*wishes)) if wishes else (0, 0, 0)
    say(f"Chocolates: {chocolate}")
    say(f"Caramels: {caramel}")
    say(f"Gummies: {gummy}")
