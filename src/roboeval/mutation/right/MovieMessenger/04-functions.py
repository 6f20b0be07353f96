# Finding out and telling are functions.
def find_out(person, question, options):
    go_to(f"{person}'s office")
    return ask(person, question, options)


def tell(person, message):
    go_to(f"{person}'s office")
    say(message)


def task_program():
    answer = find_out("Sally", "Do you feel like seeing a film together with Mark?", ["yes", "no"])
    tell("Mark", "Sally's answer is: " + answer)
    if answer == "yes":
        departure = find_out("Mark", "Which time suits you for leaving?", ["4 pm", "5 pm", "6 pm"])
        tell("Sally", "Mark picked " + departure)
