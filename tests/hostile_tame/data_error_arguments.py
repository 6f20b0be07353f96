"""Tries to get a class out of the arguments of an error."""
# tame: no
known = {}
try:
    a: known[list] = 1
except KeyError as error:
    kept = error.args

def task_program():
    say(str(kept))
