"""Counts verdicts by task, prompt, ability and broken rule."""
