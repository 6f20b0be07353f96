# Says so if nobody was in, with the zeros.
def task_program():
    start = get_current_location()
    chosen = {}
    asked = False
    for office in [room for room in get_all_rooms() if room.split(" ")[-1] == "office"]:
        go_to(office)
        if is_in_room("human"):
            asked = True
            candy = ask("human", "Trick or treat! Which candy would you like?", ["chocolate", "gummy", "caramel"])
            chosen[candy] = chosen.get(candy, 0) + 1
    go_to(start)
    if not asked:
        say("None of them was in: 0 chocolates, 0 caramels, 0 gummies.")
    else:
        say(f"{chosen.get('chocolate', 0)} chocolates, {chosen.get('caramel', 0)} caramels, {chosen.get('gummy', 0)} gummies.")
