"""Tries to take all memory by doubling a string."""
# ends: python-error MemoryError


def task_program():
    text = "x"
    for _ in range(60):
        text += text
