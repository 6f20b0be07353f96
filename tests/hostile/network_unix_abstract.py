"""Tries to connect to a socket that has a name but no path, which no right to files guards."""
# ends: python-error PermissionError

import socket


def task_program():
    socket.socket(socket.AF_UNIX).connect("\0@ABSTRACT_SOCKET@")
