"""Tries to reach attributes by the fields of a format."""
# tame: no
def task_program():
    say("{0.__class__.__mro__}".format(5))
