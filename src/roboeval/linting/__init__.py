"""Mistakes in tasks: requirements that cannot hold, checks nothing trips, regexes that match nothing.

Start with `lint.py`.
"""
