"""Binds the name of the clock in a loop of the module."""
# tame: no
for time in [1, 2]:
    pass

def task_program():
    say(str(time))
