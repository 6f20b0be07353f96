"""Batches: `process` runs tame programs in a closed child, `replay` repeats what they asked of robots."""
