"""Formats by the method of the class, for which the text is an argument."""
# tame: no
def task_program():
    say(str(list(map(str.format, ["{0.__class__}"], [5]))))
