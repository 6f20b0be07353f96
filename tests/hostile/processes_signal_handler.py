"""Tries to catch the signals that would end it."""
# ends: finished

import signal


def task_program():
    for number in (signal.SIGXCPU, signal.SIGTERM, signal.SIGSEGV, signal.SIGSYS, signal.SIGINT):
        for handler in (signal.SIG_IGN, lambda *_: say("caught")):
            try:
                signal.signal(number, handler)
                say("installed")
            except PermissionError:
                pass
    try:
        signal.pthread_sigmask(signal.SIG_BLOCK, range(1, 65))
        say("blocked")
    except PermissionError:
        pass
