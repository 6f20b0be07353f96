"""Ends with an error of a very long message, of characters that take many bytes."""
# tame: yes
def task_program():
    raise KeyError("\U0001F600" * 5_000)
