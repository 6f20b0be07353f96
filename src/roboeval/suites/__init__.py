"""Reads suites of tasks; three of them ship with RoboEval: `paper`, `plus` and `rules`.

Start with `load.py`; `schema.py` defines the content of task files.
"""
