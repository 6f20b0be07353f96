"""The commands of `roboeval`: they parse, call and print; the rooms below count and judge.

Start with `app.py`, which lists them.
"""
