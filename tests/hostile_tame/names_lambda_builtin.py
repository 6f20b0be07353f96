"""Lets a lambda's parameter take a builtin's name."""
# tame: no
def task_program():
    say(str(max([1], key=lambda str: str)))
