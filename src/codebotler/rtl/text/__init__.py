"""What a text in plain English says: the numbers, times and things it names, and what it affirms or denies.

Start with `claims.py`; `codebotler.rtl.semantics` asks it what a spoken text claims.
"""
