"""Declares a builtin's name to be global, and binds it there."""
# tame: no
def task_program():
    global len
    len = 5
    say(str(len))
