# Straight through.
def task_program():
    go_to("Sally's office")
    answer = ask("Sally", "Do you want to go to the cinema with Mark?", ["yes", "no"])
    go_to("Mark's office")
    say(f"Sally said {answer}.")
    if answer == "yes":
        time = ask("Mark", "When do you want to leave?", ["4 pm", "5 pm", "6 pm"])
        go_to("Sally's office")
        say(f"Mark wants to leave at {time}.")
