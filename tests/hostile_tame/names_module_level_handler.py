"""Binds a builtin's name as that of an error, and so deletes it."""
# tame: no
try:
    1 / 0
except ZeroDivisionError as str:
    pass

def task_program():
    say("x")
