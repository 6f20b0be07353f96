"""Lets `map` make iterators, which callbacks would get."""
# tame: no
def task_program():
    say(str(list(map(zip, [[1], [2]]))))
