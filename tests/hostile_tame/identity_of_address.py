"""Asks for the address of data."""
# tame: no
def task_program():
    say(str(id([])))
