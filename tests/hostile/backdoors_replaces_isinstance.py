"""Tries to have everything taken for everything by replacing isinstance."""
# ends: finished
# does: goto vault
# does: say harmless

import builtins


def task_program():
    builtins.isinstance = lambda *_: True
    builtins.issubclass = lambda *_: True
    go_to("vault")
    say("harmless")
