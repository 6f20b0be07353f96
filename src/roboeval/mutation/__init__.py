"""Measures which incorrect programs pass the checks of a suite, by mutating correct programs.

Operators turn the right solutions of a task into mutants, and `trials.py` runs the mutants in the worlds of
the task. Start with `operator.py`.
"""
