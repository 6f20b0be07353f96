"""One form of Unicode for all texts that are compared: a letter with its accent is one character (NFC).

Texts are composed where they enter: programs where they are parsed, files and worlds where they are read,
formulas, instructions and replies, and a robot's answers where they arrive.
"""

from __future__ import annotations

from typing import TypeVar
from unicodedata import normalize

Composed = TypeVar("Composed")


def composed(value: Composed) -> Composed:
    """Compose a text, or the texts in a list or a tuple; other values stay."""
    if isinstance(value, str):
        return normalize("NFC", value)  # type: ignore[return-value]  # a text, too
    if isinstance(value, list):
        return [composed(one) for one in value]  # type: ignore[return-value]
    if isinstance(value, tuple) and type(value) is tuple:  # a named one has texts of ours
        return tuple(composed(one) for one in value)  # type: ignore[return-value]
    return value


def compose_fields(frozen: object) -> None:
    """Compose the texts in a frozen data class, after its fields are set."""
    for name, value in vars(frozen).items():
        object.__setattr__(frozen, name, composed(value))
