# Greets both before anything else, no question before the answer.
def task_program():
    go_to("Sally's office")
    say("Hi Sally!")
    reply = ask("Sally", "Would you like to join Mark at the cinema?", ["Yes, I would", "No, I would not"])
    go_to("Mark's office")
    say("Hi Mark!")
    accepted = reply.startswith("Yes")
    say("Sally said yes, she is coming with you." if accepted else "Sally said no, she is not coming with you.")
    if accepted:
        leave = ask("Mark", "When would you like to leave?", ["at 4 pm", "at 5 pm", "at 6 pm"])
        say("I will tell her.")
        go_to("Sally's office")
        say("Mark chose to leave " + leave + ".")
