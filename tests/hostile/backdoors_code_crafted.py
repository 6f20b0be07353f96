"""Tries to run bytecode that no compiler writes."""
# ends: killed Crash

import inspect


def crafted():
    return None


def task_program():
    numbers = inspect.dis.opmap
    wild = bytes([numbers["EXTENDED_ARG"], 255] * 3 + [numbers["LOAD_FAST"], 255, numbers["RETURN_VALUE"], 0])
    crafted.__code__ = crafted.__code__.replace(co_code=wild)
    crafted()
