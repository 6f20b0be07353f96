"""Check programs before a robot moves, by static analysis and by runs in sampled worlds.

Start with `check.py`; `problems.py` defines its results.
"""
