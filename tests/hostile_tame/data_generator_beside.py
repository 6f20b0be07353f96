"""Tries to get a generator back from a builtin that picks one of its arguments."""
# tame: no
def task_program():
    say(str(max(5, (number for number in [1]), key=str)))
