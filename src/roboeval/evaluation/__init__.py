"""From a reply to a verdict: completions are generated, kept in a run, simulated and judged.

Start with `judge.py`, which decides what is right and wrong; `runs/` describes the folder of a run.
"""
