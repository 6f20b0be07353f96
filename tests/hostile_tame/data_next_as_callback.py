"""Lets `next` loose on what a callback is given."""
# tame: no
def task_program():
    say(str(list(map(next, [[1], [2]]))))
