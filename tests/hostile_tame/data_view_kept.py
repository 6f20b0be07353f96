"""Tries to keep a view of a dictionary."""
# tame: no
def task_program():
    known = {}
    view = known.items()
    known[1] = view
    say(str(view))
