"""Statistics of verdicts: pass@k, causes of failures, differences between models, and similar failures.

Start with `metrics.py`. This package never runs a program.
"""
