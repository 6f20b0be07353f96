"""Generates tasks from families. A family is a template that gives a task for each seed.

Start with `tasks.py`. From the tasks of a split, `suite.py` builds a suite.
"""
