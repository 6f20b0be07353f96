"""The commands that make runs and judge them."""
