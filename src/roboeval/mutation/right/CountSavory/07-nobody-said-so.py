# Nobody is a sentence of its own.
def task_program():
    start_room = get_current_location()
    n = 0
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("person") == True:
                response = ask("person", "Which snack do you want?", ["beef jerky", "ham sandwich", "cupcake", "donut"])
                say("Thank you, I will pass that on.")
                n += {"beef jerky": 1, "ham sandwich": 1, "cupcake": 0, "donut": 0}[response]
    go_to(start_room)
    if n == 0:
        say("Nobody picked a savory snack.")
    else:
        say(f"{n} savory snacks were picked.")
