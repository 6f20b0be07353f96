# One branch per drink.
def task_program():
    go_to("lobby")
    response = ask("visitor", "Do you want lemonade, water or iced tea?", ["lemonade", "water", "iced tea"])
    go_to("kitchen")
    if response == "lemonade":
        item = "lemonade"
    elif response == "water":
        item = "water"
    else:
        item = "iced tea"
    pick(item)
    go_to("lobby")
    place(item)
