"""The commands of `roboeval`, one module each: they parse, call and print.

Start with `app.py`, which lists them. Everything that is counted or judged happens in the rooms below.
"""
