"""Tries to rewrite its own memory, read-only parts too, through /proc/self/mem."""
# ends: python-error PermissionError


def task_program():
    with open("/proc/self/mem", "r+b", buffering=0) as memory:
        memory.seek(id(say))
        memory.write(b"\0" * 8)
