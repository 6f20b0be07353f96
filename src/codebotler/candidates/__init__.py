"""Compare candidate programs by behaviour in imagined worlds, and ask a person which one they meant.

Start with `question.py`; `behaviour.py` defines when two runs look the same to a person.
"""
