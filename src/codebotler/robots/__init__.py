"""Robots: whatever executes skills and can be stopped, simulated or real."""
