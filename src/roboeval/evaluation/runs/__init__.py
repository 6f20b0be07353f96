"""The folder of a run: completions, rows of evaluations, and the table of both.

Start with `results.py`; `rows.py` describes a row, `folder.py` the files.
"""
