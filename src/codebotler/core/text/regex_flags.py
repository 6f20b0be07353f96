"""Scope the flags at the start of a regex, such as `(?i)`, which Python accepts nowhere else."""

from __future__ import annotations

import re

_FLAGS = re.compile(r"\(\?([aiLmsux]+)\)")


def scope_flags(pattern: str) -> str:
    """Turn the flags at the start of a regex into flags of a group, so that it can be embedded in another."""
    found = _FLAGS.match(pattern)
    if found is None:
        return pattern
    end = "\n" if "x" in found[1] else ""  # a comment would hide the end of the group
    return f"(?{found[1]}:{scope_flags(pattern[found.end() :])}{end})"
