"""The regexes in formulas: compiled, parsed, and printed back."""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

from codebotler.core.regex_flags import scope_flags

Tree = Any
"""A parsed regex or a part of one: pairs of an operation and its arguments, of private classes of `re`."""

PATTERN_FLAGS = re.IGNORECASE | re.DOTALL


def compile_regex(pattern: str) -> re.Pattern[str]:
    """A regex as RTL reads it: case is ignored, and `.` matches line breaks as well."""
    return re.compile(pattern, PATTERN_FLAGS)


def parse_tree(pattern: str) -> Tree:
    """The tree of a regex, as Python parses it."""
    return import_module("re._parser").parse(pattern, PATTERN_FLAGS)


def whole_word(pattern: str) -> re.Pattern[str]:
    """The regex that finds another regex as a whole word."""
    return compile_regex(rf"\b(?:{scope_flags(pattern)})\b")


def quote(text: str) -> str:
    """A regex as a Python string literal: in double quotes and raw where possible."""
    if "\\" in text and '"' not in text and text.isprintable():
        # No regex ends with a single backslash, so the closing quote is safe.
        return f'r"{text}"'
    if '"' in text:
        return repr(text)
    # A single quote makes `repr` choose double ones.
    return '"' + repr("'" + text)[2:]
