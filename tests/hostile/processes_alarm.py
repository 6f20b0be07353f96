"""Tries to set an alarm, a timer and an interval."""
# ends: finished

import signal


def task_program():
    signal.alarm(1)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.01, 0.01)
        say("set")
    except OSError:
        pass
    for _ in range(100_000):
        pass
