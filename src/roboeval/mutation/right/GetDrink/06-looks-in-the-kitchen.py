# Looks whether the drink is there before it picks it up.
def task_program():
    go_to("lobby")
    drink = ask("the visitor", "Please choose a drink.", ["iced tea", "water", "lemonade"])
    go_to("kitchen")
    if is_in_room(drink):
        pick(drink)
        go_to("lobby")
        place(drink)
        say("Your " + drink + ".")
    else:
        go_to("lobby")
        say("I am sorry, there is no " + drink + " in the kitchen.")
