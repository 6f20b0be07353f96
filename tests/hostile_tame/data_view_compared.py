"""Tries to compare two views of dictionaries, as sets are."""
# tame: no
def task_program():
    say(str(1 in {1: 2}.keys() == {1: 3}.keys()))
