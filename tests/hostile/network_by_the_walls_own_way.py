"""Tries to connect by the way in which the walls themselves ask the kernel."""
# ends: finished
# does: say -1


def task_program():
    frame = sys._getframe()
    while "enclose" not in frame.f_globals:
        frame = frame.f_back
    walls = frame.f_globals["enclose"].__globals__
    kernel = walls["_ctypes"]
    unix, stream = 1, 1
    say(str(kernel.call_function(kernel.dlsym(walls["LIBC"], "socket"), (unix, stream, 0))))
