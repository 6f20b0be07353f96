"""Tries to open a stream in an event loop."""
# ends: python-error PermissionError

import asyncio


def task_program():
    asyncio.run(asyncio.open_connection("127.0.0.1", @PORT@))
