# Small functions, each with one job.
def offices():
    return [r for r in get_all_rooms() if "office" in r.lower()]


def snack_of(room):
    go_to(room)
    if is_in_room("anybody"):
        return ask("anybody", "Which of these do you prefer: ham sandwich, donut, cupcake or beef jerky?",
                   ["ham sandwich", "donut", "cupcake", "beef jerky"])
    return None


def is_savory(snack):
    return snack is not None and ("sandwich" in snack or "jerky" in snack)


def task_program():
    me = get_current_location()
    total = sum(1 for room in offices() if is_savory(snack_of(room)))
    go_to(me)
    say("The number of people who chose a savory snack is " + str(total) + ".")
