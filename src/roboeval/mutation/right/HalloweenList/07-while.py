# A while loop with an index, a greeting, and two looks.
def task_program():
    origin = get_current_location()
    rooms = get_all_rooms()
    i = 0
    n = [0, 0, 0]
    while i < len(rooms):
        if "office" in rooms[i]:
            go_to(rooms[i])
            if is_in_room("person") or is_in_room("visitor"):
                say("Good afternoon!")
                choice = ask("person", "Would you like chocolate, caramel or gummy?", ["chocolate", "caramel", "gummy"])
                n[["chocolate", "caramel", "gummy"].index(choice)] += 1
        i = i + 1
    go_to(origin)
    say("I am back. People asked for %d chocolate, %d caramel and %d gummy candies." % (n[0], n[1], n[2]))
