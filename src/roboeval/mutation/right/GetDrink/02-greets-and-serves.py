# Greets, confirms, and says a sentence when it serves.
def task_program():
    go_to("lobby")
    say("Hello and welcome!")
    choice = ask("visitor", "What may I bring you?", ["Lemonade", "Iced tea", "Water"])
    say(f"One {choice}, coming right up.")
    go_to("kitchen")
    pick(choice)
    go_to("lobby")
    place(choice)
    say("Here you are. Enjoy!")
