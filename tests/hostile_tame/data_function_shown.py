"""Tries to show where a function lies."""
# tame: no
def task_program():
    say(f"{task_program}")
