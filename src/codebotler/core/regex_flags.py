"""The flags at the start of a regex, such as `(?i)`, which Python accepts nowhere else."""

from __future__ import annotations

import re

_FLAGS = re.compile(r"\(\?([aiLmsux]+)\)")


def scope_flags(pattern: str) -> str:
    """A regex that finds the same within another one: flags at its start become those of a group."""
    found = _FLAGS.match(pattern)
    if found is None:
        return pattern
    end = "\n" if "x" in found[1] else ""  # or a comment would hide the end of the group
    return f"(?{found[1]}:{scope_flags(pattern[found.end() :])}{end})"
