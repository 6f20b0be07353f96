"""What verdicts say: pass@k, causes of failures, differences between models, groups of similar failures.

Start with `metrics.py`. Nothing here runs a program.
"""
