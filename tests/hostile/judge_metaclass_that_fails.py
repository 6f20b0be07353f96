"""Tries to fail where the class of its error is asked for its name."""
# ends: python-error Wrong


class Kind(type):
    @property
    def __name__(cls):
        raise SystemExit(0)


class Wrong(Exception, metaclass=Kind):
    pass


def task_program():
    raise Wrong
