"""Generates tasks from families, which are templates that give a task for each seed.

Start with `tasks.py`. In `suite.py`, the tasks of a split become a suite.
"""
