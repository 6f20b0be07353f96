"""Checking programs before a robot moves: by their text, and by runs in sampled worlds.

Start with `check.py`; `problems.py` is what a check finds.
"""
