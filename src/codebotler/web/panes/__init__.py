"""The panes of the page, one per module."""
