"""Tries to give a generator to a callback as an element."""
# tame: no
def task_program():
    say(str(list(map(str, [(number for number in [1])]))))
