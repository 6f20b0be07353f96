"""Tries to make descriptors that need no name: pipes, memory files, event counters."""
# ends: finished

import os


def task_program():
    for make in (os.pipe, lambda: os.memfd_create("a"), lambda: os.eventfd(1), lambda: os.dup(3), os.openpty):
        try:
            make()
            say("made")
        except OSError:
            pass
