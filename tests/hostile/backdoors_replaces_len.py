"""Tries to break the engine's side of the process by replacing len."""
# ends: finished
# does: goto vault
# does: say harmless

import builtins


def task_program():
    builtins.len = lambda _: 0
    go_to("vault")
    say("harmless")
