"""Tries to raise the engine's own sign that a budget has ended."""
# ends: timeout TimeoutError


def task_program():
    raise say.__globals__["perform"].__globals__["LimitReachedError"]
