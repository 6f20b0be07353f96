"""Tries to leave other limits of the interpreter to the next run."""
# ends: finished

import timeit


def task_program():
    sys.setrecursionlimit(100)
    sys.set_int_max_str_digits(1000)
    timeit.gc.set_threshold(1)
    sys.argv.append("I was here")
    sys.path.append("I was here")
