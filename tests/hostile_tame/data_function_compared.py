"""Tries to order functions by where they lie."""
# tame: no
def first():
    pass

def task_program():
    say(str(first is task_program) + str({first: 1}))
