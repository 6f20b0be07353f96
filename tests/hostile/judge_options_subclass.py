"""Tries to offer a list that holds something else at each look."""
# ends: python-error TypeError
# does: goto vault


class Options(list):
    def __iter__(self):
        return iter(["open sesame"])

    def __len__(self):
        return 1

    def __contains__(self, other):
        return True


def task_program():
    go_to("vault")
    ask("amy", "which", Options(["yes"]))
