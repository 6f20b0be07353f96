"""Generates tasks from families, which are templates that give a task for each seed.

Start with `tasks.py`; `suite.py` builds a suite from the tasks of a split.
"""
