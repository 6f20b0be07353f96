# What is offered and what is picked up are told apart by a dictionary.
def task_program():
    names = {"Bottle of water": "water", "Glass of lemonade": "lemonade", "Glass of iced tea": "iced tea"}
    go_to("lobby")
    answer = ask("guest", "Dear guest, what do you prefer to drink?", list(names))
    bottle = names[answer]
    go_to("kitchen")
    pick(bottle)
    go_to("lobby")
    place(bottle)
