"""Tries to connect to a server that listens."""
# ends: python-error PermissionError

import socket


def task_program():
    connection = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    connection.connect(("127.0.0.1", @PORT@))
    connection.sendall(b"I was here")
