"""Statistics of verdicts: pass@k, causes of failures, differences between models, similar failures.

Start with `metrics.py`. Nothing here runs a program.
"""
