"""Binds a builtin's name in a comprehension, which reaches the scope around it."""
# tame: no
def task_program():
    say(str([(len := 1) for number in [1]]) + str(len))
