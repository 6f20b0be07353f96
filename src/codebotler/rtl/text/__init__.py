"""Find claims in plain English: numbers of things, times of day, affirmations and denials.

Start with `claims.py`, the patterns of formulas that use the other modules.
"""
