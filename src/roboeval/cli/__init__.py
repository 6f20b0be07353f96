"""The commands of `roboeval`: they parse options and print results; other packages count and judge.

Start with `app.py`, which lists the commands.
"""
