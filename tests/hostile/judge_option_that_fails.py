"""Tries to fail in the middle of a question."""
# ends: python-error KeyError
# does: goto vault


class Option:
    def __str__(self):
        raise KeyError("open sesame")


def task_program():
    go_to("vault")
    ask("amy", "which", ["yes", Option()])
