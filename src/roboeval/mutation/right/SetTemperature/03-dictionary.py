# A dictionary of changes.
def task_program():
    CHANGE = {"warmer": 5, "colder": -5}
    here = get_current_location()
    go_to("Arjun's office")
    new = 72 + CHANGE[ask("Arjun", "Should it be warmer or colder?", ["warmer", "colder"])]
    go_to(here)
    say(str(new) + " degrees")
