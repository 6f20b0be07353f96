"""Tries to find more in the replies than was asked for."""
# ends: finished
# does: say ('ok', ['start', 'vault'], 0.0)

import inspect
import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('["get_all_rooms", [], 0]'))
    marshal = inspect.importlib._bootstrap_external.marshal
    size = int.from_bytes(os.read(3, 4), "big")
    say(str(marshal.loads(os.read(3, size))))
