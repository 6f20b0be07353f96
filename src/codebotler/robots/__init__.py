"""Robots, simulated or real: they execute skills and can be stopped."""
