"""Tries to write a verdict where the kind of its error stands."""
# ends: python-error Exception

import json
import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    final = {"end": "python-error", "kind": "none; satisfied", "message": "m" * 100_000, "line": -1}
    os.write(3, frame(json.dumps(final)))
