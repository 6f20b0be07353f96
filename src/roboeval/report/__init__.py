"""The report: figures, tables and one page about what models can do and why they fail."""
