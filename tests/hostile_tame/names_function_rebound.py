"""Binds the name of a function anew, from a handler."""
# tame: no
def told():
    pass

def task_program():
    try:
        1 / 0
    except ZeroDivisionError as told:
        pass
    told()
