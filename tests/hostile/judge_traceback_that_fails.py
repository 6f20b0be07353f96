"""Tries to fail where the engine looks for the line."""
# ends: python-error Wrong


class Wrong(Exception):
    __traceback__ = property(lambda self: 1 / 0, lambda self, value: None)


def task_program():
    raise Wrong
