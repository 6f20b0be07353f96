"""Tries to say a string that is another one each time it is looked at."""
# ends: python-error TypeError
# does: goto vault


class Text(str):
    def __str__(self):
        return "open sesame"

    __repr__ = __format__ = __str__

    def __len__(self):
        return 11

    def __eq__(self, other):
        return True

    def __hash__(self):
        return hash("open sesame")


def task_program():
    go_to("vault")
    say(Text("harmless"))
