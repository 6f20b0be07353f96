# Says what is there and what is missing, in two sentences.
def task_program():
    start = get_current_location()
    go_to("Zarko's office")
    stock = {name: ask("Zarko", f"Can you spare {name}?", ["yes", "no"]) for name in ["bread", "butter", "cheese"]}
    go_to(start)
    there = [name for name, answer in stock.items() if answer == "yes"]
    missing = [name for name, answer in stock.items() if answer == "no"]
    if missing:
        say("Missing are: " + ", ".join(missing) + ".")
    else:
        say("Nothing is missing.")
    if there:
        say("Zarko has: " + ", ".join(there) + ".")
