"""Robot programs in simulated worlds."""
