# Greets, thanks, and asks in whole sentences.
def task_program():
    origin = get_current_location()
    ingredients = ["slices of bread", "cheese", "butter"]
    lacking = []
    go_to("Zarko's office")
    say("Hello Zarko! I would like to know what you have for a grilled cheese.")
    for thing in ingredients:
        answer = ask("Zarko", f"Zarko, do you have {thing} for a grilled cheese?", ["Yes, I do.", "No, I don't."])
        if answer == "No, I don't.":
            lacking.append(thing)
    say("Thank you, Zarko.")
    go_to(origin)
    if not lacking:
        say("Zarko lacks nothing.")
    elif len(lacking) == 1:
        say(f"Zarko does not have {lacking[0]}.")
    else:
        say("Zarko does not have " + ", ".join(lacking[:-1]) + " and " + lacking[-1] + ".")
