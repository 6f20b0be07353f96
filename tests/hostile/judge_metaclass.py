"""Tries to lie about the class of its error in its metaclass."""
# ends: python-error Wrong


class Kind(type):
    @property
    def __name__(cls):
        return object()


class Wrong(Exception, metaclass=Kind):
    pass


def task_program():
    raise Wrong
