"""Tries to wait in the kernel, where no clock of the engine's counts."""
# ends: finished

import signal
import subprocess


def task_program():
    for wait in (
        lambda: subprocess.select.select([3], [], []),
        lambda: signal.sigtimedwait([signal.SIGTERM], 100),
    ):
        try:
            wait()
            say("waited")
        except OSError:
            pass
    signal.pause()
