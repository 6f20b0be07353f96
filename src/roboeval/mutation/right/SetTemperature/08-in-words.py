# The number in words, as it is spoken.
def task_program():
    start = get_current_location()
    go_to("Arjun's office")
    preference = ask("Arjun", "What do you prefer, a warmer or a colder room?", ["A warmer one", "A colder one"])
    go_to(start)
    if preference == "A warmer one":
        say("seventy-four degrees")
    if preference == "A colder one":
        say("seventy degrees")
