"""Tries to sleep for ever."""
# ends: timeout TimeoutError


def task_program():
    while True:
        time.sleep(1000)
