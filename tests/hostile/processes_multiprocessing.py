"""Tries to share its work among processes."""
# ends: python-error ModuleNotFoundError

import concurrent.futures


def task_program():
    with concurrent.futures.ProcessPoolExecutor() as pool:
        pool.submit(print).result()
