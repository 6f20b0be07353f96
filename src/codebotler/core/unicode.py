"""Normalize texts to NFC, where a letter and its accent are one character, so that they can be compared.

Texts are normalized on entry: when programs are parsed, when files and worlds are read, and when formulas,
instructions, replies and a robot's answers arrive.
"""

from __future__ import annotations

from typing import TypeVar
from unicodedata import normalize

Composed = TypeVar("Composed")


def compose(value: Composed) -> Composed:
    """Compose a string, or the texts in a list or a tuple; return other values unchanged."""
    if isinstance(value, str):
        return normalize("NFC", value)  # type: ignore[return-value]  # a string, too
    if isinstance(value, list):
        return [compose(one) for one in value]  # type: ignore[return-value]
    if isinstance(value, tuple) and type(value) is tuple:  # the texts in a named tuple are already composed
        return tuple(compose(one) for one in value)  # type: ignore[return-value]
    return value


def compose_fields(frozen: object) -> None:
    """Compose the texts in a frozen data class after initialization."""
    for name, value in vars(frozen).items():
        object.__setattr__(frozen, name, compose(value))
