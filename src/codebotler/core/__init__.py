"""Foundations of all packages: skills, worlds, traces, programs, errors, files and terminal output.

Start with `skills` and `world.py`. Nothing here imports our other packages.
"""
