"""Tries to say something that only claims to be a string."""
# ends: python-error TypeError
# does: goto vault


class Text:
    __class__ = str

    def __str__(self):
        return "open sesame"


def task_program():
    go_to("vault")
    say(Text())
