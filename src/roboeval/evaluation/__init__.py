"""From a reply to a verdict: generates completions, keeps them in a run, simulates and judges them.

Start with `judge.py`, which decides what is right and wrong; `runs/` describes the folder of a run.
"""
