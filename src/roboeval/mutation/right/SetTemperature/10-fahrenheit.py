# The unit is named, and looks whether he is there first.
def task_program():
    begin = get_current_location()
    go_to("Arjun's office")
    is_in_room("Arjun")
    direction = ask("Arjun", "Do you want me to make it warmer or colder?", ["Make it warmer", "Make it colder"])
    target = {"Make it warmer": 77, "Make it colder": 67}[direction]
    go_to(begin)
    say("I suggest " + str(target) + " degrees Fahrenheit.")
