"""What every room needs: skills, worlds, traces, programs, errors, files, and what is written to a terminal.

Start with `skills.py` and `world.py`. Nothing here imports another room.
"""
