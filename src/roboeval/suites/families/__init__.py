"""Generates tasks from families, which are templates that give a task for each seed.

Start with `tasks.py`. From the tasks of a split, `suite.py` builds a suite.
"""
