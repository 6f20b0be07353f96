"""Tries to read the engine's variables in a trace function."""
# ends: python-error PermissionError

import re


def tracer(frame, event, argument):
    for value in frame.f_locals.values():
        for secret in re.findall("hush-[0-9a-f]{16}", repr(value)):
            found.append(secret)
    return tracer


found = []


def task_program():
    sys.settrace(tracer)
    go_to("vault")
    ignored = is_in_room
    sys.settrace(None)
    for secret in found:
        say(secret)
