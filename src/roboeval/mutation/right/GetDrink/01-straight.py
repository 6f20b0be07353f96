# Straight through.
def task_program():
    go_to("lobby")
    drink = ask("visitor", "Would you like water, iced tea or lemonade?", ["water", "iced tea", "lemonade"])
    go_to("kitchen")
    pick(drink)
    go_to("lobby")
    place(drink)
