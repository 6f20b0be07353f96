# Greets first, tells her where it comes from.
def task_program():
    origin = get_current_location()
    go_to("Jill's office")
    say("Good morning, Jill! I come with an invitation.")
    answers = [ask("Jill", "Would you like to have lunch together today?", ["yes", "no"])]
    if answers[0] == "yes":
        answers.append(ask("Jill", "Which of these times would you prefer?", ["12:00", "1:00"]))
        say("Good, I will pass that on.")
    go_to(origin)
    if len(answers) == 2:
        say("I asked Jill. " + "She says yes, and prefers " + answers[1] + ".")
    else:
        say("I asked Jill. She says no.")
