# A function from the wish to the number.
def better_for(wish):
    now = 72
    return now + 4 if "warm" in wish else now - 4


def task_program():
    start = get_current_location()
    go_to("Arjun's office")
    wish = ask("Arjun", "Warmer or colder?", ["I would like it warmer", "I would like it colder"])
    go_to(start)
    say(f"{better_for(wish)} degrees would suit Arjun.")
