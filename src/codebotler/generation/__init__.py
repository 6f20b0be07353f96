"""Generate programs from instructions; start with `generate.py`."""
