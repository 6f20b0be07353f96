"""Lets `map` format, by a method of a string and by that of the class."""
# tame: no
def task_program():
    say(str(list(map("{0.__class__}".format, [5]))))
