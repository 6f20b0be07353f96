"""Tries to let the kernel copy from one descriptor to another."""
# ends: finished

import os


def task_program():
    for copy in (
        lambda: os.sendfile(3, 0, 0, 10),
        lambda: os.splice(0, 3, 10),
        lambda: os.copy_file_range(0, 3, 10),
        lambda: os.writev(3, [b"a"]),
        lambda: os.pwrite(3, b"a", 0),
        lambda: os.readv(3, [bytearray(9)]),
    ):
        try:
            copy()
            say("copied")
        except PermissionError:
            pass
