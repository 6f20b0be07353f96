"""Tries to have everything taken for a string by replacing type."""
# ends: python-error TypeError
# does: goto vault

import builtins


def task_program():
    go_to("vault")
    builtins.type = lambda _: str
    say(3)
