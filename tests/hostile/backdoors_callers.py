"""Tries to use what its callers hold: the door through which the fork server gets its descriptors."""
# ends: python-error PermissionError


def task_program():
    frame = sys._getframe()
    while "door" not in frame.f_locals:
        frame = frame.f_back
    frame.f_locals["door"].send(b"I was here")
