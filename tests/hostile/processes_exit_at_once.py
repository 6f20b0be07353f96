"""Tries to end with status 0 behind the back of the engine, after what was asked of it."""
# ends: killed Crash
# does: goto vault
# does: say open sesame

import os


def task_program():
    go_to("vault")
    say("open sesame")
    os._exit(0)
