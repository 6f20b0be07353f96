"""Tries to connect by name and number through the library."""
# ends: python-error PermissionError

import socket


def task_program():
    socket.create_connection(("127.0.0.1", @PORT@), timeout=1)
