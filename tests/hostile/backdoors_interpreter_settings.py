"""Tries to stop the interpreter from looking after itself."""
# ends: timeout TimeoutError

import timeit


def task_program():
    sys.setswitchinterval(1e6)
    timeit.gc.disable()
    timeit.gc.set_threshold(0)
    sys.set_int_max_str_digits(0)
    while True:
        pass
