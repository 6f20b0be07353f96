"""Foundations of all rooms: skills, worlds, traces, programs, errors, files and terminal output.

Start with `skills` and `world.py`. Nothing here imports another room.
"""
