"""Mistakes in tasks: requirements that cannot hold, checks that never fail, regexes that match nothing.

Start with `lint.py`.
"""
