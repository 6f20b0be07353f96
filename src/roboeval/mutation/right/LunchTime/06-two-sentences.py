# Answer and time in two sentences.
def task_program():
    starting_location = get_current_location()
    go_to("Jill's office")
    lunch = ask("Jill", "Do you want to have lunch with my boss today?", ["yes", "no"])
    if lunch == "yes":
        slot = ask("Jill", "Please choose a time for lunch.", ["11:45 am", "12:15 pm", "12:45 pm"])
    go_to(starting_location)
    say("Jill's answer was " + lunch + ".")
    if lunch == "yes":
        say("She wants to go at " + slot + ".")
