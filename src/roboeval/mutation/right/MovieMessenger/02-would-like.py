# Whole sentences for what she said.
def task_program():
    go_to("Sally's office")
    wants = ask("Sally", "Hello Sally, would you like to go to the movies with Mark?", ["Yes", "No"]) == "Yes"
    go_to("Mark's office")
    if wants:
        say("Sally would like to go to the movies with you.")
        hour = ask("Mark", "At what time would you like to leave?", ["6 pm", "5 pm", "4 pm"])
        go_to("Sally's office")
        say("You leave at " + hour + ".")
    else:
        say("Sally would not like to go to the movies with you.")
