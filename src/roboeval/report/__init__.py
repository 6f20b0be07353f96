"""The report: figures, tables and one page about how models do and why they fail.

Start with `writing.py`, which assembles the sections; `page.yaml` holds their text.
"""
