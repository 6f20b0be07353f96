"""Normalize texts to NFC, where a letter and its accent are one character, so that they can be compared.

Texts are normalized on entry: when programs are parsed, when files and worlds are read, and when formulas,
instructions, replies and a robot's answers arrive.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, TypeVar
from unicodedata import combining, normalize

MAX_ACCENTS = 30
"""The most accents in a row that are normalized, as in Unicode's Stream-Safe Text Format."""

SHORT_TEXT = 100
"""Characters that are normalized quickly, whatever they are."""

Composed = TypeVar("Composed")


def compose(value: Composed) -> Composed:
    """Compose a string, or the texts in a list or a tuple; return other values unchanged."""
    if isinstance(value, str):
        return normalize_text("NFC", value)  # type: ignore[return-value]  # a string, too
    if isinstance(value, list):
        return [compose(one) for one in value]  # type: ignore[return-value]  # a copy has the type of the value
    if isinstance(value, tuple) and type(value) is tuple:  # the texts in a named tuple are already composed
        return tuple(compose(one) for one in value)  # type: ignore[return-value]  # a copy has the type of the value
    return value


def compose_fields(frozen: object) -> None:
    """Compose the texts in a frozen data class after initialization."""
    for name, value in vars(frozen).items():
        object.__setattr__(frozen, name, compose(value))


def normalize_text(form: Literal["NFC", "NFD"], text: str) -> str:
    """Normalize a text, but keep longer rows of accents as they are.

    Python sorts a row of accents in quadratic time, and no other thread, such as the one for STOP, can run
    meanwhile.
    """
    if len(text) <= SHORT_TEXT or text.isascii():
        return normalize(form, text)
    return "".join(part if is_long else normalize(form, part) for part, is_long in _split(text))


def _split(text: str) -> Iterator[tuple[str, bool]]:
    """Yield the parts of a text, and whether each is a letter with too many accents."""
    start = letter = 0  # where the current part and the last letter begin
    for at, character in enumerate((*text, " ")):
        if combining(character):
            continue
        if at - letter > MAX_ACCENTS + 1:
            yield text[start:letter], False
            yield text[letter:at], True
            start = at
        letter = at
    yield text[start:], False
