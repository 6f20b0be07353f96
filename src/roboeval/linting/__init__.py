"""Lints tasks: finds requirements that cannot hold, checks that never fail, and dead regexes.

Start with `lint.py`.
"""
