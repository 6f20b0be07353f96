# The decision in two sentences, the time in two sentences.
def task_program():
    go_to("Sally's office")
    is_in_room("Sally")
    decision = ask("Sally", "Are you going to see a film with Mark?", ["yes", "no"])
    say("Thanks, I will let Mark know.")
    go_to("Mark's office")
    is_in_room("Mark")
    say("I have been to Sally.")
    say("Yes, she is coming." if decision == "yes" else "No, she is not coming.")
    if decision == "yes":
        choice = ask("Mark", "And when do you want to leave?", ["5 pm", "4 pm", "6 pm"])
        go_to("Sally's office")
        say("I have been to Mark.")
        say("He picked " + choice + ".")
