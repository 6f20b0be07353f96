"""Reads and writes the folder of a run: its completions, its evaluations, and the table of both.

Start with `results.py`. `rows.py` describes a row, and `folder.py` describes the files.
"""
