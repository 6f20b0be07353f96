"""Reads suites of tasks, of which three ship with RoboEval: `paper`, `plus` and `rules`.

Start with `load.py`. The content of task files is defined in `schema.py`.
"""
