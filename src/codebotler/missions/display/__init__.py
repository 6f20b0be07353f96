"""Views of a running mission, for people and agents."""
