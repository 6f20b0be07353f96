# Asking and reporting are functions.
CANDIES = ["caramel", "chocolate", "gummy"]


def poll(room):
    go_to(room)
    if is_in_room("person"):
        return [ask("person", "Which of the three do you want for Halloween?", CANDIES)]
    return []


def shopping_list(wishes):
    return ", ".join(str(wishes.count(candy)) + " x " + candy for candy in CANDIES)


def task_program():
    start = get_current_location()
    wishes = []
    for room in get_all_rooms():
        if "office" in room:
            wishes += poll(room)
    go_to(start)
    say("The shopping list: " + shopping_list(wishes))
