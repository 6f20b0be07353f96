# Three sums, three questions.
def task_program():
    start = get_current_location()
    chocolates = caramels = gummies = 0
    numbers = ["0", "1", "2", "3", "4"]
    for room in get_all_rooms():
        if "office" in room:
            go_to(room)
            if is_in_room("person"):
                chocolates += int(ask("person", "How many chocolates do you want?", numbers))
                caramels += int(ask("person", "How many caramels do you want?", numbers))
                gummies += int(ask("person", "How many gummies do you want?", numbers))
    go_to(start)
    say(f"Total: {chocolates} chocolates, {caramels} caramels and {gummies} gummies.")
