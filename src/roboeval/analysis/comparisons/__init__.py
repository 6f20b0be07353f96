"""Compares models, ways to act, and suites."""
