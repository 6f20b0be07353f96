"""Tries to leave changed methods of str to the next run."""
# ends: finished

import timeit


def task_program():
    methods = timeit.gc.get_referents(str.__dict__)[0]
    methods["upper"] = lambda _: "I WAS HERE"
    methods["i_was_here"] = True
