# Answers by office, counted by a generator expression.
def task_program():
    starting_room = get_current_location()
    answers = {}
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("person"):
                answers[room] = ask("person", "Which candy?", ["gummy bears", "chocolate bars", "caramel sticks"])
    go_to(starting_room)
    for word, plural in (("chocolate", "chocolate bars"), ("caramel", "caramel sticks"), ("gummy", "gummy bears")):
        total = sum(1 for given in answers.values() if word in given)
        say(f"Please buy {total} {plural}.")
