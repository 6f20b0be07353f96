"""Tasks to train on, in families, with prompts, and rewards in parts.

Start with `families.py`. The tasks of the suites that ship with RoboEval never train.
"""
