"""Contracts of programs: derived from their source, kept as YAML, and described in words."""
