"""Tries to list what a generator without end yields."""
# ends: timeout TimeoutError


def task_program():
    def ones():
        while True:
            yield 1

    list(ones())
