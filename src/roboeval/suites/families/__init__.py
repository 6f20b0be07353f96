"""Families of tasks: templates from which each seed makes a task to train on or to evaluate with.

Start with `tasks.py`; `suite.py` makes a suite of the tasks of a split.
"""
