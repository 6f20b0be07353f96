# Noon among the times.
def task_program():
    here = get_current_location()
    go_to("Jill's office")
    wants = ask("Jill", "Hello Jill, would you like to join us for lunch?", ["no", "yes"]) == "yes"
    when = ask("Jill", "When?", ["noon", "12:30 pm", "1 pm"]) if wants else None
    go_to(here)
    if when is None:
        say("Jill answered no.")
    else:
        say("Jill answered yes, and the time that she chose is " + when + ".")
