"""Tries to wait for a clock that moves only when it sleeps."""
# ends: timeout TimeoutError


def task_program():
    start = time.time()
    while time.time() < start + 10:
        pass
