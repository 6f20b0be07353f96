"""Simulated worlds and the robots in them."""
