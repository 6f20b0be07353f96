# Four ingredients, also something to fry it in.
INGREDIENTS = ("bread", "cheese", "butter", "oil")


def task_program():
    me = get_current_location()
    go_to("Zarko's office")
    got, not_got = [], []
    for ingredient in INGREDIENTS:
        answer = ask("Zarko", f"Do you have {ingredient} for a grilled cheese?", ["yes", "no"])
        (got if answer == "yes" else not_got).append(ingredient)
    go_to(me)
    if not_got:
        say("What Zarko does not have: " + ", ".join(not_got) + ".")
    else:
        say("Zarko has all of it.")
