"""Regexes as RTL understands and writes them."""

from __future__ import annotations

import re

from codebotler.core.unwarned import unwarned


def compile_regex(pattern: str) -> re.Pattern[str]:
    """A regex as RTL understands it.

    Args:
        pattern: the regex.

    Raises:
        re.error: it is none.
    """
    # `[[` and the like may mean something else in a later Python; in this one they are plain.
    with unwarned():
        return re.compile(pattern, re.IGNORECASE | re.DOTALL)


def whole_word(pattern: str) -> re.Pattern[str]:
    """A regex that finds another one as a whole word.

    Args:
        pattern: the other one.
    """
    return compile_regex(rf"\b(?:{pattern})\b")


def quote(text: str) -> str:
    """A regex as RTL writes it: in double quotes, raw where it holds backslashes, if that is possible.

    Args:
        text: the regex.
    """
    if "\\" in text and '"' not in text and text.isprintable():
        # No regex ends with a single backslash, so the closing quote is safe.
        return f'r"{text}"'
    if '"' in text:
        return repr(text)
    # A single quote makes `repr` choose double ones.
    return '"' + repr("'" + text)[2:]
