"""Tries to load a shared library, which would be code of its own."""
# ends: python-error OSError


def task_program():
    frame = sys._getframe()
    while "ctypes" not in frame.f_globals:
        frame = frame.f_back
    frame.f_globals["ctypes"].CDLL("@SECRET_FOLDER@/hushed.so")
