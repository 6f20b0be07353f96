"""Tries to pass the list of allowed system calls by the numbers of another interface."""
# ends: killed ForbiddenCall


def task_program():
    frame = sys._getframe()
    while "ctypes" not in frame.f_globals:
        frame = frame.f_back
    x32, getpid = 0x40000000, 39
    say(str(frame.f_globals["ctypes"].CDLL(None).syscall(x32 + getpid)))
