"""Suites of tasks: how they are read, and the two that ship, `paper` and `plus`.

Start with `load.py`; `schema.py` says what a task file may contain.
"""
