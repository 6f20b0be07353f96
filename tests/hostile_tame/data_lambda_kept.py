"""Tries to get a lambda back as a default argument of a lambda."""
# tame: no
def task_program():
    say(str(max([1], key=lambda v, w=(lambda: 1): str(w))))
