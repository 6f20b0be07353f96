"""Generates the completions of a run, in rounds or through batch endpoints, and checks them."""
