"""Tries to let an error carry a builtin."""
# tame: no
def task_program():
    raise ValueError(len)
