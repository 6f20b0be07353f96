"""Tries to run in the engine's part, whenever memory is searched for what nobody needs."""
# ends: finished
# does: say a

import gc


def task_program():
    def callback(phase, about):
        say("b")
        raise SystemExit

    gc.set_threshold(1)
    gc.callbacks.append(callback)
    gc.callbacks.clear()
    gc.callbacks.append(lambda phase, about: sys.exit(1))
    say("a")
