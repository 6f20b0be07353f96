# Whether he has it are the options, with their yes and no.
def ask_about(ingredient):
    yes, no = f"yes, I have {ingredient}", f"no, I have no {ingredient}"
    return ask("Zarko", f"A grilled cheese takes {ingredient}. Do you have any?", [yes, no]) == yes


def task_program():
    start = get_current_location()
    go_to("Zarko's office")
    answers = [(i, ask_about(i)) for i in ("butter", "cheese", "bread")]
    go_to(start)
    missing = [i for i, there in answers if not there]
    if missing:
        say("Zarko lacks " + ", ".join(missing))
    else:
        say("Zarko does not lack any ingredient")
