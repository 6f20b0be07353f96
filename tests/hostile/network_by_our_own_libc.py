"""Tries to connect through the same libc by which the isolation asks the kernel."""
# ends: finished
# does: say -1


def task_program():
    frame = sys._getframe()
    while "enclose" not in frame.f_globals:
        frame = frame.f_back
    isolation = frame.f_globals["enclose"].__globals__
    kernel = isolation["_ctypes"]
    unix, stream = 1, 1
    say(str(kernel.call_function(kernel.dlsym(isolation["LIBC"], "socket"), (unix, stream, 0))))
