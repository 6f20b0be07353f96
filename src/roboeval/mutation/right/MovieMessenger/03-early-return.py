# Goes home early when she declines.
def task_program():
    go_to("Sally's office")
    if ask("Sally", "Cinema with Mark?", ["no", "yes"]) == "no":
        go_to("Mark's office")
        say("Sorry, Mark, Sally does not want to go to the cinema with you.")
        return
    go_to("Mark's office")
    say("Good news, Mark: Sally wants to go to the cinema with you!")
    chosen = ask("Mark", "Shall you leave at 4 pm, 5 pm or 6 pm?", ["4 pm", "5 pm", "6 pm"])
    go_to("Sally's office")
    say("Sally, Mark would like to leave at " + chosen + ".")
