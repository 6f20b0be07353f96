"""Tries to keep a generator, and to show where it lies."""
# tame: no
def task_program():
    numbers = (number for number in [1, 2])
    say(str(numbers))
