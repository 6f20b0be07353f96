"""Formats the results of `analysis` as tables and texts for a terminal."""
