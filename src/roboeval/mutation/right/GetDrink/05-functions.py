# Fetching is a function with a from and a to.
def fetch(thing, source, destination):
    go_to(source)
    pick(thing)
    go_to(destination)
    place(thing)


def task_program():
    go_to("lobby")
    fetch(ask("visitor", "Water, iced tea or lemonade?", ["water", "iced tea", "lemonade"]), "kitchen", "lobby")
