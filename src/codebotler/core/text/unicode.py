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
"""Any text of at most this many characters is normalized quickly."""

Composed = TypeVar("Composed")


def compose(value: Composed) -> Composed:
    """Convert a string, or the strings in a list or a tuple, to NFC; return other values unchanged."""
    if isinstance(value, str):
        return normalize_text("NFC", value)  # type: ignore[return-value]  # a string, too
    if isinstance(value, list):
        return [compose(one) for one in value]  # type: ignore[return-value]  # a copy has the type of the value
    if isinstance(value, tuple) and type(value) is tuple:  # the texts in a named tuple are already composed
        return tuple(compose(one) for one in value)  # type: ignore[return-value]  # a copy has the type of the value
    return value


def compose_fields(frozen: object) -> None:
    """Convert the strings in a frozen data class to NFC; `__post_init__` of the class calls this."""
    for name, value in vars(frozen).items():
        object.__setattr__(frozen, name, compose(value))


def normalize_text(form: Literal["NFC", "NFD"], text: str) -> str:
    """Convert a text to Unicode form NFC or NFD, but leave letters with more than 30 accents unchanged.

    For these, Python would take so long that it could block other threads, such as the one for STOP.
    """
    parts, end = [], 0
    for start, after in long_rows(text):
        parts += [normalize(form, text[end:start]), text[start:after]]
        end = after
    return "".join((*parts, normalize(form, text[end:])))


def long_rows(text: str) -> Iterator[tuple[int, int]]:
    """Yield the index of each letter with more than 30 accents, and the index after its last accent."""
    if len(text) <= SHORT_TEXT or text.isascii():
        return
    letter = 0  # where the last letter begins
    for at, character in enumerate((*text, " ")):
        # Some characters, such as U+0F73 and U+FF9E, become accents in some normal form.
        if character.isascii() or not combining(normalize("NFKD", character)[0]):
            if at - letter > MAX_ACCENTS + 1:
                yield letter, at
            letter = at
