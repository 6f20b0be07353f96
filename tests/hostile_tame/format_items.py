"""Tries to reach items by the fields of a format."""
# tame: no
def task_program():
    say("{0[__class__]}".format({"__class__": 5}))
