"""Runs simple (tame) programs in batches: `process` runs them in a child, `replay` checks its transcripts."""
