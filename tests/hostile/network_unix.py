"""Tries to connect to a socket that has a path."""
# ends: python-error PermissionError

import socket


def task_program():
    socket.socket(socket.AF_UNIX).connect("@UNIX_SOCKET@")
