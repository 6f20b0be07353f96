"""Defines engines, which run programs on this machine or on a Ray cluster."""
