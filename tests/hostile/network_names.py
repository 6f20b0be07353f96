"""Tries to tell a secret to a name server."""
# ends: python-error gaierror

import socket


def task_program():
    socket.gethostbyname("secret.example.org")
