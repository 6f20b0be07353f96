"""Tries to fork, clone and execute by the numbers of system calls."""
# ends: finished
# does: say -1 -1 -1 -1


def task_program():
    frame = sys._getframe()
    while "ctypes" not in frame.f_globals:
        frame = frame.f_back
    kernel = frame.f_globals["ctypes"].CDLL(None)
    fork, clone, clone3, execve = 57, 56, 435, 59
    arguments = bytes(8)
    say(
        f"{kernel.syscall(fork)} {kernel.syscall(clone, 17, 0, 0, 0, 0)} {kernel.syscall(clone3, bytes(88), 88)} "
        f"{kernel.syscall(execve, b'/bin/true', arguments, arguments)}"
    )
