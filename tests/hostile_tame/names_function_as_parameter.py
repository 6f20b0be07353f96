"""Lets a parameter take the name of a function, so that the same name is data and function."""
# tame: no
def told(inner):
    def inner():
        return 1
    return inner

def task_program():
    say(str(told(5)))
