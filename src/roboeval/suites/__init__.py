"""Suites of tasks: how they are read, and the three that ship, `paper`, `plus` and `rules`.

Start with `load.py`; `schema.py` says what a task file may contain.
"""
