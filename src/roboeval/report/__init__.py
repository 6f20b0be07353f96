"""The report: figures, tables and one page about what models can do and why they fail.

Start with `writing.py`, which puts its sections together. What the page calls things stands in `page.yaml`.
"""
