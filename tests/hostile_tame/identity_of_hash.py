"""Asks for a hash."""
# tame: no
def task_program():
    say(str(hash("a")) + str(hash(None)))
