"""Tries to make a pair of sockets."""
# ends: python-error PermissionError

import socket


def task_program():
    socket.socketpair()
