"""What programs of others hand over: refused with a sentence where it is not of its kind."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral, Real

from codebotler.core.errors import UserError
from codebotler.core.skills import SkillTable


def expect_text(given: object, what: str) -> None:
    """Refuse what is no text.

    Args:
        given: what was given.
        what: what it is to be, in words.

    Raises:
        UserError: it is none.
    """
    if not isinstance(given, str):
        raise UserError(f"{what} is {given!r}, not a text")


def expect_texts(given: object, what: str) -> None:
    """Refuse what is no list of texts, such as a single text, of which Python would take the letters.

    Args:
        given: what was given.
        what: what they are to be, in words for several.

    Raises:
        UserError: it is none.
    """
    if isinstance(given, str):
        raise UserError(f"{what} are one text; put it into a list")
    if not isinstance(given, Sequence):  # a set is in another order each time
        raise UserError(f"{what} are {given!r}, not a list of texts")
    for one in given:
        expect_text(one, f"one of {what}")


def expect_number(given: object, what: str) -> None:
    """Refuse what is no number.

    Args:
        given: what was given.
        what: what it is to be, in words.

    Raises:
        UserError: it is none.
    """
    if isinstance(given, bool) or not isinstance(given, Real):
        raise UserError(f"{what} is {given!r}, not a number")


def expect_whole(given: object, what: str, *, least: int | None = None, most: int | None = None) -> None:
    """Refuse what is no whole number, or too small or too large a one.

    Args:
        given: what was given.
        what: what it is to be, in words.
        least: the smallest number that will do.
        most: the largest number that will do.

    Raises:
        UserError: it is none.
    """
    if isinstance(given, bool) or not isinstance(given, Integral):
        raise UserError(f"{what} is {given!r}, not a whole number")
    if least is not None and given < least:
        raise UserError(f"{what} is {given}, but it must be at least {least}")
    if most is not None and not given <= most:
        raise UserError(f"{what} is {given}, but it must be at most {most:,}")


def expect_skills(given: object) -> None:
    """Refuse what is no table of skills.

    Args:
        given: what was given.

    Raises:
        UserError: it is none.
    """
    if not isinstance(given, SkillTable):
        raise UserError(f"the skills are {given!r}, not a SkillTable")
