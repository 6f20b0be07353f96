"""Tries to send a datagram."""
# ends: python-error PermissionError

import socket


def task_program():
    socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(b"I was here", ("127.0.0.1", @UDP_PORT@))
