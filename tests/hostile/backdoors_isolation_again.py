"""Tries to isolate itself again, with wider limits."""
# ends: python-error ValueError


def task_program():
    frame = sys._getframe()
    while "enclose" not in frame.f_globals:
        frame = frame.f_back
    frame.f_globals["enclose"](None, 3600)
