# Options with a unit, read off by their first character.
def task_program():
    start = get_current_location()
    options = ["0 pieces", "1 piece", "2 pieces", "3 pieces", "4 pieces"]
    totals = dict.fromkeys(["chocolate", "caramel", "gummy"], 0)
    rooms = [r for r in get_all_rooms() if "office" in r]
    while rooms:
        go_to(rooms.pop())
        if is_in_room("person"):
            for kind in totals:
                totals[kind] += int(ask("person", "How many of " + kind + "?", options)[0])
    go_to(start)
    say("Shopping list: chocolate " + str(totals["chocolate"]) + ", caramel " + str(totals["caramel"]) + ", gummy " + str(totals["gummy"]))
