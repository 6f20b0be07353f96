"""Looks into a set that the compiler makes a constant of."""
# tame: no
def task_program():
    say(str("a" in {"a", "b"}))
