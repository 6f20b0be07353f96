# A plain loop over the rooms, the count as a digit.
def task_program():
    start = get_current_location()
    savory = 0
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("person"):
                snack = ask("person", "Which snack would you like?", ["cupcake", "ham sandwich", "donut", "beef jerky"])
                if snack == "ham sandwich" or snack == "beef jerky":
                    savory += 1
    go_to(start)
    say(f"{savory} people went for something savory.")
