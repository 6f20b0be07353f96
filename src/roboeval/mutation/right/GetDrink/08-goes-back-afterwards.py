# Goes back to where it started when all is done.
def task_program():
    start = get_current_location()
    go_to("the lobby")
    drink = ask("person", "Good afternoon. Can I get you a water, an iced tea or a lemonade?",
                ["water", "iced tea", "lemonade"])
    go_to("the kitchen")
    pick(drink)
    go_to("the lobby")
    place(drink)
    go_to(start)
