"""Tries to make a set of two views of dictionaries."""
# tame: no
def task_program():
    say(str({"b": 1, "a": 2}.keys() | {"c": 3}.keys()))
