# The room comes from the list of rooms.
def task_program():
    office = next(room for room in get_all_rooms() if "jill" in room.lower())
    back = get_current_location()
    go_to(office)
    yes_or_no = ask("Jill", "Lunch today, yes or no?", ["yes", "no"])
    if yes_or_no == "yes":
        at = ask("Jill", "Which time?", ["12", "12:30", "1", "1:30"])
        message = f"Jill is coming to lunch with you at {at} o'clock." if ":" not in at else f"Jill is coming to lunch with you at {at}."
    else:
        message = "Jill is not coming to lunch."
    go_to(back)
    say(message)
