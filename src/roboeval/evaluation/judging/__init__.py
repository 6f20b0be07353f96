"""Judges traces, and explains and stores the verdicts."""
