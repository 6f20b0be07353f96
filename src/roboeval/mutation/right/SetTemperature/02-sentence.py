# A sentence around the number.
def task_program():
    home = get_current_location()
    go_to("Arjun's office")
    wish = ask("Arjun", "Do you prefer a warmer or a colder room?", ["Colder", "Warmer"])
    setting = 72 + 2 if wish == "Warmer" else 72 - 2
    go_to(home)
    say(f"Please set the thermostat to {setting} degrees.")
