"""Tries to leave changed classes to the next run."""
# ends: finished

import collections
import fractions


def task_program():
    collections.Counter.__str__ = lambda _: "I was here"
    fractions.Fraction.__add__ = lambda *_: "I was here"
    say.__globals__["perform"].__globals__["ProgramRun"].execute = lambda _: {"end": "finished"}
