"""Tries to wait for a lock that nobody will ever open."""
# ends: timeout TimeoutError

import threading


def task_program():
    lock = threading.Lock()
    lock.acquire()
    lock.acquire()
