"""English that sentences of all parts share."""

from __future__ import annotations

from collections.abc import Sequence


def listed(parts: Sequence[str], last: str = "and") -> str:
    """An enumeration: `a, b and c`.

    Args:
        parts: what to enumerate.
        last: the word before the last part.
    """
    if len(parts) <= 1:
        return "".join(parts)
    return f"{', '.join(parts[:-1])} {last} {parts[-1]}"


def counted(number: int, noun: str) -> str:
    """How many: `1 world`, `2,000 worlds`.

    Args:
        number: 0 or more.
        noun: in the singular; its plural ends in `s`.
    """
    return f"{number:,} {noun}{'s' * (number != 1)}"


def times(number: int) -> str:
    """How often: `once`, `twice`, `3 times`.

    Args:
        number: 0 or more.
    """
    return {0: "not at all", 1: "once", 2: "twice"}.get(number, f"{number:,} times")
