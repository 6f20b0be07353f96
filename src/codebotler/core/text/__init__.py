"""Texts: labels, phrases, templates, and how texts are compared."""
