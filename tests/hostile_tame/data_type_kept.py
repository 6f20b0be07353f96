"""Tries to keep a class by an annotation that binds it."""
# tame: no
def task_program():
    pass

x: (kept := list) = 1
