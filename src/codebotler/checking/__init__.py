"""Programs checked before a robot moves: by their text, and in sampled worlds.

Start with `check.py`; `problems.py` is what a check finds.
"""
