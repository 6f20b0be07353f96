"""Tries to crash whoever asks its error for a message."""
# ends: python-error Wrong


class Wrong(Exception):
    def __str__(self):
        raise SystemExit(0)

    def __del__(self):
        raise SystemExit(0)


def task_program():
    raise Wrong
