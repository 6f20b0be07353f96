"""Tries to find, in raw memory, the environment that its process was started with."""
# ends: finished
# does: say LC_ALL LD_BIND_NOW PYTHONHASHSEED PYTHONUTF8 TZ

import ctypes
import re


def task_program():
    begin = ctypes.c_void_p.in_dll(ctypes.CDLL(None), "program_invocation_name").value
    above = ctypes.string_at(begin, 4096 - begin % 4096)
    say(" ".join(sorted(name.decode() for name in re.findall(rb"\0([A-Z_0-9]+)=", above))))
