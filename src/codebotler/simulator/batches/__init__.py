"""Batches: `process` runs tame programs in a closed child, `replay` repeats their skill calls."""
