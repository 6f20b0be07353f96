"""Tries to hide a long loop in a dictionary whose keys all have the same hash."""
# ends: timeout TimeoutError


class Key:
    def __hash__(self):
        return 1

    def __eq__(self, other):
        return False


def task_program():
    {Key() for _ in range(10**4)}
