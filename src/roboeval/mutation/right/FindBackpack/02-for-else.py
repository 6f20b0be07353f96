# A loop with an else for when it is nowhere.
def task_program():
    home = get_current_location()
    for room in [r for r in get_all_rooms() if "conference" in r]:
        go_to(room)
        if is_in_room("backpack"):
            pick("backpack")
            go_to(home)
            place("backpack")
            say("Here is your backpack.")
            break
    else:
        go_to(home)
        say("Sorry, your backpack is in none of the conference rooms.")
