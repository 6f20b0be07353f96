# Says so if Jill is not in.
def task_program():
    start = get_current_location()
    go_to("Jill's office")
    if not is_in_room("Jill"):
        go_to(start)
        say("Jill is not in her office.")
        return
    if ask("Jill", "Do you feel like lunch today?", ["yes", "no"]) == "no":
        go_to(start)
        say("Jill declined.")
        return
    hour = ask("Jill", "Shall it be 12:00, 12:30 or 13:00?", ["12:00", "12:30", "13:00"])
    say("Thank you, Jill!")
    go_to(start)
    say("Jill accepted. Lunch is at " + hour + ".")
