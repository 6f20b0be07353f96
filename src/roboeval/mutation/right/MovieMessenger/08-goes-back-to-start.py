# Goes back to where it started when the messages are delivered.
def task_program():
    start = get_current_location()
    go_to("Sally's office")
    response = ask("Sally", "Mark asks if you want to go to the cinema with him. Do you?", ["Yes", "No"])
    go_to("Mark's office")
    say("Sally says " + response.lower() + ".")
    if response == "Yes":
        when = ask("Mark", "4 pm, 5 pm or 6 pm?", ["4 pm", "5 pm", "6 pm"])
        go_to("Sally's office")
        say("Mark says " + when + ".")
    go_to(start)
