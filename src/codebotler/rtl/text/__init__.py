"""What a text in plain English claims: numbers of things, times of day, and what it affirms or denies.

Start with `claims.py`: the texts of formulas that use the other modules.
"""
