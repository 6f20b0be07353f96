"""English for messages: enumerations, numbers, plurals and shortened texts."""

from __future__ import annotations

import re
from collections.abc import Sequence


def listed(parts: Sequence[str], last: str = "and") -> str:
    """Join words in an enumeration, such as `a, b and c`."""
    if len(parts) <= 1:
        return "".join(parts)
    return f"{', '.join(parts[:-1])} {last} {parts[-1]}"


def elide_list(parts: Sequence[str], most: int = 5) -> list[str]:
    """Shorten a long enumeration to its first `most` parts and, for example, `3 more`, but never `1 more`."""
    return [*parts] if len(parts) <= most + 1 else [*parts[:most], f"{len(parts) - most:,} more"]


def counted(number: int, noun: str) -> str:
    """Return a number with a regular noun, such as `1 world` or `2,000 worlds`."""
    return f"{number:,} {noun}{'s' * (number != 1)}"


def with_sentence(text: str, sentence: str) -> str:
    """Add a sentence to a text, after a full stop if the text ends without a punctuation mark."""
    text = text.rstrip()
    stop = "" if not text or text[-1] in ".!?:;…。" else "."
    return f"{text}{stop} {sentence}"


def times(number: int) -> str:
    """Return a frequency in words, such as `once`, `twice` or `3 times`."""
    return {0: "not at all", 1: "once", 2: "twice"}.get(number, f"{number:,} times")


def brief(text: str, most: int = 70) -> str:
    """Put a string on one line, and shorten it to at most `most` characters."""
    return brief_part(text.strip(), most)


def brief_part(text: str, most: int = 70) -> str:
    """Shorten a part of a longer text as `brief` does, but keep the spaces at its ends."""
    line = re.sub(r"\s+", " ", text)
    return line if len(line) <= most else f"{line[: most - 1].rstrip()}…"
