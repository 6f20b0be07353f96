"""Tries to keep the class of an error, which it could ask for all others."""
# tame: no
def task_program():
    kinds = [ValueError]
    say(str(kinds))
