# A queue that is worked off, everybody asked whether sweet things are wanted counted out.
def task_program():
    back = get_current_location()
    queue = [r for r in get_all_rooms() if "office" in r]
    sweet = asked = 0
    while queue:
        room = queue.pop(0)
        go_to(room)
        if is_in_room("person"):
            asked += 1
            choice = ask("person", "A cupcake, a ham sandwich, a donut or beef jerky?",
                         ["cupcake", "ham sandwich", "donut", "beef jerky"])
            if choice in ["cupcake", "donut"]:
                sweet += 1
    go_to(back)
    say(f"I am back. {asked - sweet} of the {asked} people I met chose a savory snack.")
