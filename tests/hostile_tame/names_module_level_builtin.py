"""Binds a builtin's name for all functions."""
# tame: no
len = 5

def task_program():
    say(str(len))
