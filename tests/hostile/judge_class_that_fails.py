"""Tries to be taken for the end of a budget."""
# ends: python-error Wrong


class Wrong(Exception):
    @property
    def __class__(self):
        raise SystemExit(0)


def task_program():
    raise Wrong
