"""Generate programs from instructions. Start with `generate.py`."""
