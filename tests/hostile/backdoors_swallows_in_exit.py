"""Tries to swallow the end of its budget in a context manager."""
# ends: timeout TimeoutError


class Swallow:
    def __enter__(self):
        pass

    def __exit__(self, *_):
        return True


def task_program():
    with Swallow():
        while True:
            pass
    with Swallow():
        go_to("vault")
    with Swallow():
        say("open sesame")
