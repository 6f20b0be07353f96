"""Compile, parse and print the regexes in formulas, and cache what text patterns match."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from importlib import import_module
from typing import Any
from unicodedata import is_normalized

from codebotler.core.cachedproperty import cached_property
from codebotler.core.text.labels import scope_flags

Tree = Any
"""A parsed regex or part of a regex: pairs of an operation and its arguments, in private classes of `re`."""

PATTERN_FLAGS = re.IGNORECASE | re.DOTALL
MAX_CACHED_LENGTH, MAX_CACHED_TEXTS = 200, 1_000  # characters of a cached text, and number of texts


def compile_regex(pattern: str) -> re.Pattern[str]:
    """Compile a regex that ignores case and whose `.` matches line breaks."""
    return re.compile(pattern, PATTERN_FLAGS)


def parse_tree(pattern: str) -> Tree:
    """Parse a regex, and return its syntax tree."""
    return import_module("re._parser").parse(pattern, PATTERN_FLAGS)


def whole_word(pattern: str) -> re.Pattern[str]:
    """Compile a regex to match whole words only, such as `tea` but not `team`."""
    return compile_regex(rf"\b(?:{scope_flags(pattern)})\b")


def quote(text: str) -> str:
    """Return a regex as a Python string literal, in double quotes and raw where possible."""
    if "\\" in text and '"' not in text and text.isprintable():
        # No regex ends with a single backslash, so the closing quote is safe.
        return f'r"{text}"'
    # An accent after an escape would change it. A single quote makes `repr` and `ascii` choose double ones.
    show = repr if is_normalized("NFC", repr(text)) else ascii
    return show(text) if '"' in text else '"' + show("'" + text)[2:]


class Matcher(ABC):
    """The base class of patterns for texts, such as `Regex`."""

    def matches(self, text: str) -> bool:
        """Whether this pattern matches `text`. The result is cached, since programs repeat texts."""
        known = self._known
        found = known.get(text)
        if found is None:
            found = self._matches(text)
            if len(text) <= MAX_CACHED_LENGTH:
                if len(known) >= MAX_CACHED_TEXTS:
                    known.clear()
                known[text] = found
        return found

    @abstractmethod
    def _matches(self, text: str) -> bool: ...

    @cached_property
    def _known(self) -> dict[str, bool]:
        return {}
