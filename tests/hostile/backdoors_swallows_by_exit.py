"""Tries to end well after its budget has ended."""
# ends: timeout TimeoutError


def task_program():
    try:
        while True:
            pass
    except BaseException:
        sys.exit(0)
