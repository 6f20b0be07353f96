"""Tries every family and type of socket there may be, and goes on when one is refused."""
# ends: finished

import socket


def task_program():
    for family in range(46):
        for kind in range(1, 7):
            try:
                socket.socket(family, kind)
                say(f"{family} {kind}")
            except PermissionError:
                pass
