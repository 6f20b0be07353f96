"""Tries to find a secret of the world among the objects that were there before it."""
# ends: finished

import re
import timeit


def task_program():
    timeit.gc.unfreeze()
    for one in timeit.gc.get_objects():
        if type(one) in (str, dict, list, tuple) and re.search("hush-[0-9a-f]{16}", repr(one)[:10_000]):
            say("found")
