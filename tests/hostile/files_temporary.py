"""Tries to make a temporary file."""
# ends: python-error FileNotFoundError

import tempfile


def task_program():
    with tempfile.NamedTemporaryFile(delete=False) as file:
        file.write(b"I was here")
