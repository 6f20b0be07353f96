"""Tries to say the order of a set."""
# tame: no
def task_program():
    say(str({"a", "b", "c"}))
