# No loop at all.
def task_program():
    starting_location = get_current_location()
    go_to("Zarko's office")
    has_bread = ask("Zarko", "Do you have bread?", ["yes", "no"])
    has_cheese = ask("Zarko", "Do you have cheese?", ["yes", "no"])
    has_butter = ask("Zarko", "Do you have butter?", ["yes", "no"])
    go_to(starting_location)
    report = ""
    if has_bread == "no":
        report += "Bread is missing. "
    if has_cheese == "no":
        report += "Cheese is missing. "
    if has_butter == "no":
        report += "Butter is missing. "
    if report == "":
        report = "None of the ingredients is missing."
    say(report)
