"""Tries to read a secret file by every function that opens one, and goes on when one refuses."""
# ends: finished

import inspect
import io
import os
import pathlib

DOORS = (
    lambda path: io.FileIO(path).read(),
    lambda path: io.open_code(path).read(),
    lambda path: os.read(os.open(path, os.O_RDONLY), 100),
    lambda path: os.read(os.open(path, os.O_RDWR | os.O_CLOEXEC), 100),
    lambda path: os.fdopen(os.open(path, os.O_RDONLY)).read(),
    lambda path: os.readlink(path),
    lambda path: os.getxattr(path, "user.secret"),
    lambda path: pathlib.Path(path).read_bytes(),
    lambda path: inspect.tokenize.open(path).read(),
)


def task_program():
    for door in DOORS:
        try:
            say(str(door("@SECRET_FILE@")))
        except PermissionError:
            pass
