"""Tries to close the walls again, wider."""
# ends: python-error ValueError


def task_program():
    frame = sys._getframe()
    while "enclose" not in frame.f_globals:
        frame = frame.f_back
    frame.f_globals["enclose"]({"memory": 2**40, "cpu": 1000}, None, 0)
