"""Families of tasks: templates that generate a task for each seed, for training or evaluation.

Start with `tasks.py`; `suite.py` builds a suite from the tasks of a split.
"""
