"""Tries to keep a method, and to show where it lies."""
# tame: no
def task_program():
    append = [].append
    say(str(append))
