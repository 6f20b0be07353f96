"""Checks of programs before a robot moves: static analysis, and runs in sampled worlds.

Start with `check.py`; `problems.py` defines its results.
"""
