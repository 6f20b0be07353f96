"""Tries to speak when everything is over, from finalizers."""
# ends: finished

import weakref


class Last:
    def __del__(self):
        say("open sesame")


def task_program():
    global last, other
    last = Last()
    last.itself = last
    other = set("abc")
    weakref.finalize(last, say, "open sesame")
    weakref.finalize(other, say, "open sesame")
