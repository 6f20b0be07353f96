"""Supports training with prompts, and with rewards and their components.

Start with `prompts.py`. Tasks come from families, never from the suites that ship with RoboEval.
"""
