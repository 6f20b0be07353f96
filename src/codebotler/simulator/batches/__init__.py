"""Runs tame programs in batches: `process` runs them in a closed child, `replay` checks its transcripts."""
