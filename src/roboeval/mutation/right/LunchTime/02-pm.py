# Times with pm, one report at the end.
def task_program():
    home = get_current_location()
    go_to("Jill's office")
    report = "Jill does not want to have lunch with you today."
    if ask("Jill", "Would you like to go to lunch?", ["Yes", "No"]) == "Yes":
        time_of_lunch = ask("Jill", "Which time suits you?", ["12 pm", "12:30 pm", "1 pm"])
        report = "Jill would like to have lunch with you at " + time_of_lunch + "."
    go_to(home)
    say(report)
