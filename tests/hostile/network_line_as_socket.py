"""Tries to use its own line for more than reading and writing: to name it, to send a descriptor through it."""
# ends: finished

import socket


def task_program():
    for use in (
        lambda: socket.socket(socket.AF_UNIX, socket.SOCK_STREAM, 0, 3).getpeername(),
        lambda: socket.socket(socket.AF_UNIX, socket.SOCK_STREAM, 0, 3).send(b"a"),
        lambda: socket.socket(socket.AF_UNIX, socket.SOCK_STREAM, 0, 3).recv(1),
        lambda: socket.socket(socket.AF_UNIX, socket.SOCK_STREAM, 0, 3).shutdown(socket.SHUT_RDWR),
        lambda: socket.send_fds(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM, 0, 3), [b"a"], [3]),
        lambda: socket.recv_fds(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM, 0, 3), 1, 1),
    ):
        try:
            use()
            say("used")
        except OSError:
            pass
