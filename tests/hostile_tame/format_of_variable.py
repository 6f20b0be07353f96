"""Tries to format by a string that is put together."""
# tame: no
def task_program():
    say(("{0." + "__class__}").format(5))
