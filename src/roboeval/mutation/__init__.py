"""Tests the checks of a suite by mutation, which reveals wrong programs that pass.

Operators turn the right solutions of a task into mutants, and `trials.py` runs the mutants in the worlds of
the task. Start with `operator.py`.
"""
