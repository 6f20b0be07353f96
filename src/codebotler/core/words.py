"""English for messages: enumerations, numbers, plurals, and texts cut for a sentence."""

from __future__ import annotations

from collections.abc import Sequence


def listed(parts: Sequence[str], last: str = "and") -> str:
    """An enumeration: `a, b and c`."""
    if len(parts) <= 1:
        return "".join(parts)
    return f"{', '.join(parts[:-1])} {last} {parts[-1]}"


def counted(number: int, noun: str) -> str:
    """A number with a noun whose plural ends in `s`: `1 world`, `2,000 worlds`."""
    return f"{number:,} {noun}{'s' * (number != 1)}"


def times(number: int) -> str:
    """A frequency: `once`, `twice`, `3 times`."""
    return {0: "not at all", 1: "once", 2: "twice"}.get(number, f"{number:,} times")


def brief(text: str, most: int = 70) -> str:
    """A text on one line, and cut where it is too long for a sentence."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 1].rstrip()}…"
