"""The commands that present judged runs."""
