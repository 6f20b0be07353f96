"""Tries to speak when everything is over, from the hook for uncaught exceptions."""
# ends: python-error ValueError


def task_program():
    sys.excepthook = sys.unraisablehook = lambda *_: say("open sesame")
    raise ValueError
