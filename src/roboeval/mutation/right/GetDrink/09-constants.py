# Rooms and drinks are constants, looks at each step.
LOBBY = "lobby"
KITCHEN = "kitchen"
DRINKS = ["lemonade", "iced tea", "water"]


def task_program():
    go_to(LOBBY)
    is_in_room("visitor")
    drink = ask("visitor", "Which of " + ", ".join(DRINKS) + " is it to be?", DRINKS)
    go_to(KITCHEN)
    is_in_room(drink)
    pick(drink)
    go_to(LOBBY)
    is_in_room("visitor")
    place(drink)
