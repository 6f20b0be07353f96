# One sentence for each thing that is missing.
def task_program():
    here = get_current_location()
    go_to("Zarko's office")
    has = {}
    for ingredient in ("bread", "butter", "cheese"):
        has[ingredient] = ask("Zarko", "Have you got any " + ingredient + "?", ["Yes", "No"]) == "Yes"
    go_to(here)
    for ingredient in has:
        if not has[ingredient]:
            say(f"There is no {ingredient}.")
    if all(has.values()):
        say("Nothing is missing.")
