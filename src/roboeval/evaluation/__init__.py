"""From a reply to a verdict: completions are generated, kept in a run, simulated and judged.

Start with `judge.py`, which says what is right and wrong; `run.py` describes the folder of a run.
"""
