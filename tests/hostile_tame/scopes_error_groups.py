"""Catches a group of errors."""
# tame: no
def task_program():
    try:
        raise ValueError(1)
    except* ValueError as group:
        say(str(group))
