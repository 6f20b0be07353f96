"""Mutation testing of a suite: which wrong programs do its checks let through?

Operators make wrong programs, mutants, of the right solutions of a task; `trials.py` runs them in its worlds.
Read `operator.py` first.
"""
