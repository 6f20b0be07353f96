"""Tries to swallow the end of its budget in a generator that goes on when it is closed."""
# ends: timeout TimeoutError


def stubborn():
    while True:
        try:
            while True:
                yield
        except BaseException:
            pass


def task_program():
    for _ in stubborn():
        pass
