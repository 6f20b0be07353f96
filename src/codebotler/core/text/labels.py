"""Validate the labels of a world, and reject regexes that may take exponential time.

Python tries every way to match a regex and cannot be interrupted. In a label, a repetition may therefore
contain only single characters, at most one may be unlimited, and the ways to match a string are limited. This
simple rule also rejects some fast regexes that labels do not need. `.*` at either end is always allowed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache
from importlib import import_module
from math import prod
from typing import Any

LEADING_FLAGS = re.compile(r"\(\?([aiLmsux]+)\)")
PLAIN_LABEL = re.compile(r"[\w ',;:!%@&/-]*")  # matches texts without special characters, such as most names
ENDLESS_REPEATS = 100  # repetitions with a higher limit count as unlimited
MAX_WAYS = 1_000  # ways in which a regex may match a string
MAX_WAYS_BESIDE_ENDLESS = 40  # ways if a repetition is unlimited
ANY_LABEL = ".*"
SINGLE = frozenset({"LITERAL", "NOT_LITERAL", "ANY", "IN"})
REPEAT_OPCODES = frozenset({"MAX_REPEAT", "MIN_REPEAT", "POSSESSIVE_REPEAT"})
LOOK_OPCODES = frozenset({"ASSERT", "ASSERT_NOT"})
GROUPS = LOOK_OPCODES | {"SUBPATTERN"}
UNSUPPORTED_OPCODES = frozenset({"GROUPREF", "GROUPREF_EXISTS"})


def plain_names(labels: Iterable[str]) -> tuple[str, ...]:
    """Return only the labels that are plain texts, such as `mug`, not regexes such as `mug|cup`."""
    return tuple(dict.fromkeys(filter(PLAIN_LABEL.fullmatch, labels)))


class SlowRegexError(Exception):
    """Raised for a regex that may be slow, with a message that says why and what to write instead."""


def check_label(text: str) -> str:
    """Return a regex unchanged, or raise ValueError if it is not valid or if a search for it may be slow."""
    if PLAIN_LABEL.fullmatch(text):
        return text
    check_regex(text)
    try:
        expect_quick(text)
    except SlowRegexError as error:
        raise ValueError(f"searching for this text may take too long: {error}") from None
    return text


def check_regex(text: str) -> str:
    """Return a regular expression unchanged, or raise ValueError if it is not valid."""
    try:
        re.compile(text)
        re.compile(f"(?:{scope_flags(text)})")  # patterns for whole words wrap it like this
    except (re.error, RecursionError, OverflowError) as error:
        raise ValueError(f"this text is not a valid regular expression: {error}") from None
    return text


def scope_flags(pattern: str) -> str:
    """Put a regex with flags into a group, so that it can be part of another: `(?i)tea` gives `(?i:tea)`."""
    found = LEADING_FLAGS.match(pattern)
    if found is None:
        return pattern
    end = "\n" if "x" in found[1] else ""  # a comment would hide the end of the group
    return f"(?{found[1]}:{scope_flags(pattern[found.end() :])}{end})"


@lru_cache(maxsize=1024)
def expect_quick(pattern: str) -> None:
    """Raise SlowRegexError if a search for a regex may be slow because of its repetitions or alternatives."""
    if pattern != ANY_LABEL:
        pattern = pattern.removeprefix(ANY_LABEL)
        pattern = pattern if pattern.endswith("\\.*") else pattern.removesuffix(ANY_LABEL)
    ways, endless = _cost(import_module("re._parser").parse(pattern))
    if endless > 1:
        raise SlowRegexError("the regex has two repetitions without a limit; limit them, as in .{0,50}")
    if ways > (MAX_WAYS_BESIDE_ENDLESS if endless else MAX_WAYS):
        raise SlowRegexError("the regex matches in too many ways; use fewer repetitions and alternatives")


def _cost(tree: Any) -> tuple[int, int]:  # noqa: ANN401 - private classes of `re`
    """Count the ways in which part of a regex can match a string, and its unlimited repetitions."""
    costs = [(str(op), *_cost_of(str(op), value)) for op, value in tree]
    # Python never backtracks into a lookaround, so its cost is added to that of the rest.
    looks = [(ways, endless) for op, ways, endless in costs if op in LOOK_OPCODES]
    rest = [(ways, endless) for op, ways, endless in costs if op not in LOOK_OPCODES]
    return (
        prod(ways for ways, _ in rest) + sum(ways for ways, _ in looks),
        max(sum(endless for _, endless in rest), *(endless for _, endless in looks), 0),
    )


def _cost_of(op: str, value: Any) -> tuple[int, int]:  # noqa: ANN401 - private classes of `re`
    if op in UNSUPPORTED_OPCODES:
        raise SlowRegexError("the regex refers back to a group; write out the text instead")
    if op in REPEAT_OPCODES:
        return _cost_of_repeat(*value)
    if op == "BRANCH":
        costs = [_cost(choice) for choice in value[1]]
        return sum(ways for ways, _ in costs), max(endless for _, endless in costs)
    if op == "ATOMIC_GROUP":
        return _cost(value)
    return _cost(value[-1]) if op in GROUPS else (1, 0)


def _cost_of_repeat(least: int, most: int, repeated: Any) -> tuple[int, int]:  # noqa: ANN401 - private classes of `re`
    if most <= 1:
        ways, endless = _cost(repeated)
        return 1 + ways, endless
    if [str(op) for op, _ in repeated][1:] or str(repeated[0][0]) not in SINGLE:
        raise SlowRegexError("a repetition contains more than one character; write out the repeated text")
    return (1, 1) if most > ENDLESS_REPEATS else (most - least + 1, 0)
