"""What lies in the folder of a run: completions, rows of evaluations, and all of it as one table.

Start with `results.py`; `rows.py` describes a row, `folder.py` which file is what.
"""
