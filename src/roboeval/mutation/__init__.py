"""Mutation testing of a suite: which wrong programs pass its checks?

Operators turn the right solutions of a task into mutants; `trials.py` runs these in the worlds of the task.
Start with `operator.py`.
"""
