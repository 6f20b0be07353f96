# Greets, thanks, and says the candies in another order.
def task_program():
    beginning = get_current_location()
    gummy, caramel, chocolate = 0, 0, 0
    choices = ["0", "1", "2", "3", "4"]
    for room in sorted(get_all_rooms()):
        if "office" in room:
            go_to(room)
            if is_in_room("person"):
                say("Happy Halloween!")
                gummy += int(ask("person", "How many gummies would you like, from 0 to 4?", choices))
                caramel += int(ask("person", "And how many caramels?", choices))
                chocolate += int(ask("person", "And how many chocolates?", choices))
                say("Thank you!")
    go_to(beginning)
    say(f"I am back. You must buy {gummy} gummies, {caramel} caramels and {chocolate} chocolates.")
