"""Provides prompts and missions for training models, and rewards with their components.

Start with `prompts.py`. Tasks come from families, never from the suites that ship with RoboEval.
"""
