"""From an instruction in plain words to a checked robot program that can be stopped at any moment."""

__version__ = "0.1.0"
