"""Runs tame programs in batches: `process` in a closed child, `replay` to check its transcripts."""
