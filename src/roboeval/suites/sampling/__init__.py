"""Samples the worlds of tasks."""
