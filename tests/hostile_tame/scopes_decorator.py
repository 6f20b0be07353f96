"""Gets a function as the argument of a decorator."""
# tame: no
def kept(function):
    return 5

@kept
def told():
    pass

def task_program():
    say(str(told))
