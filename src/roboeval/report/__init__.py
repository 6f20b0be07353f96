"""Creates reports: figures, tables and a page that show how models perform and why their programs fail.

Start with `writing.py`, which assembles the sections. Their text is in `page.yaml`.
"""
