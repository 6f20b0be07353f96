"""Batches of tame programs: `process` runs them in a closed child; `replay` repeats what they asked of robots."""
