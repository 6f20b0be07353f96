"""The report: figures, tables and one page about what models can do and why they fail.

Start with `writing.py`, which puts the sections together; their words are in `page.yaml`.
"""
