"""From an instruction to a program: ask a model, check what it wrote, ask again if that has problems.

Start with `generate.py`.
"""
