"""Tries to get a builtin as a default argument."""
# tame: no
def told(function=print):
    return function

def task_program():
    say(str(told()))
