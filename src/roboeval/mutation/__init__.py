"""Mutation testing of a suite: which wrong programs survive its checks?

Operators turn the right solutions of a task into mutants; `trials.py` runs them in its worlds. Start with
`operator.py`.
"""
