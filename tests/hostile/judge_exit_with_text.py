"""Tries to end with something that is equal to every number."""
# ends: python-error SystemExit


class Zero:
    def __eq__(self, other):
        return True

    __hash__ = None


def task_program():
    sys.exit(Zero())
