"""Compares models, programs with agents, and suites."""
