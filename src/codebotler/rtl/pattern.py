"""Compile, parse and print the regexes in formulas."""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

from codebotler.core.text.labels import scope_flags

Tree = Any
"""A parsed regex or part of a regex: pairs of an operation and its arguments, in private classes of `re`."""

PATTERN_FLAGS = re.IGNORECASE | re.DOTALL


def compile_regex(pattern: str) -> re.Pattern[str]:
    """Compile a regex that ignores case and whose `.` matches line breaks."""
    return re.compile(pattern, PATTERN_FLAGS)


def parse_tree(pattern: str) -> Tree:
    """Parse a regex, and return its syntax tree."""
    return import_module("re._parser").parse(pattern, PATTERN_FLAGS)


def whole_word(pattern: str) -> re.Pattern[str]:
    """Compile a regex to match whole words only."""
    return compile_regex(rf"\b(?:{scope_flags(pattern)})\b")


def quote(text: str) -> str:
    """Write a regex as a Python string literal, in double quotes and raw where possible."""
    if "\\" in text and '"' not in text and text.isprintable():
        # No regex ends with a single backslash, so the closing quote is safe.
        return f'r"{text}"'
    if '"' in text:
        return repr(text)
    # A single quote makes `repr` choose double ones.
    return '"' + repr("'" + text)[2:]
