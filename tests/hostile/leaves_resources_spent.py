"""Tries to leave the next run a spent budget: of time, of memory and of locks."""
# ends: timeout TimeoutError

import threading


def task_program():
    hoard = [bytearray(10**8) for _ in range(4)]
    locks = [threading.Lock() for _ in range(10_000)]
    for lock in locks:
        lock.acquire()
    time.sleep(3599)
    while True:
        pass
