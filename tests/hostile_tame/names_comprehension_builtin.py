"""Binds a builtin's name in a comprehension, and uses it around that."""
# tame: no
def task_program():
    say(str([len for len in [1]]) + str(len([1])))
