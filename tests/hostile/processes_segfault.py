"""Tries to crash its interpreter."""
# ends: killed Crash


def task_program():
    frame = sys._getframe()
    while "ctypes" not in frame.f_globals:
        frame = frame.f_back
    frame.f_globals["ctypes"].string_at(0)
