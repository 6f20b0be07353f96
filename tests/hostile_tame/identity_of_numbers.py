"""Asks whether two numbers are one object."""
# tame: no
def task_program():
    number = 5
    say(str(number is 5) + str("a" is get_current_location()))
