"""The commands of `roboeval`, which parse options and print results. Other packages count and judge.

Start with `app.py`, which lists the commands.
"""
