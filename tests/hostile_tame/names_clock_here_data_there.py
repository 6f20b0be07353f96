"""Imports the clock in a function within one where its name stands for data."""
# tame: no
def task_program():
    time = 5
    def inner():
        import time
        return time
    say(str(inner()) + str(time))
