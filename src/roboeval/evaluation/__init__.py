"""Generates completions, saves them in a run, simulates the programs and judges them.

Start with `judging/judge.py`, which decides whether a program is right. The modules in `runs/` describe the
folder of a run.
"""
