"""Labels of a world are regexes; those whose search may take exponential time are refused by a simple rule.

Python tries every way to match, and nothing can interrupt it meanwhile. So in a world, a repeat holds single
characters only, one repeat at most has no limit, and few ways are left to match the same text. That refuses
some regexes that are quick; names of rooms, things and people, and answers, need no others. `.*` at the start
or the end of a label changes nothing and costs nothing.
"""

from __future__ import annotations

import re
from functools import lru_cache
from importlib import import_module
from math import prod
from typing import Any

from codebotler.core.regex_flags import scope_flags

PLAIN_LABEL = re.compile(
    r"[\w ',;:!%@&/-]*"
)  # texts, most names among them, that are regexes which find themselves
ENDLESS_REPEATS = 100  # times from which a repeat counts as one without limit
MOST_WAYS, MOST_BESIDE_ENDLESS = 1_000, 40  # to match one text, the second beside a repeat without limit
ANY_LABEL = ".*"
SINGLE = frozenset({"LITERAL", "NOT_LITERAL", "ANY", "IN"})
REPEAT_OPCODES = frozenset({"MAX_REPEAT", "MIN_REPEAT", "POSSESSIVE_REPEAT"})
LOOK_OPCODES = frozenset({"ASSERT", "ASSERT_NOT"})
GROUPS = LOOK_OPCODES | {"SUBPATTERN"}
UNSUPPORTED_OPCODES = frozenset({"GROUPREF", "GROUPREF_EXISTS"})


class SlowRegexError(Exception):
    """A regex may take long to find; the text says why, and what to write instead."""


def check_label(text: str) -> str:
    """Return a label, unless it is no regular expression, or one that may take long to find.

    Raises:
        ValueError: it is one of these; the message says which.
    """
    if PLAIN_LABEL.fullmatch(text):
        return text
    check_regex(text)
    try:
        expect_quick(text)
    except SlowRegexError as error:
        raise ValueError(f"finding it may take too long: {error}") from None
    return text


def check_regex(text: str) -> str:
    """Return a regular expression; a ValueError for any other text."""
    try:
        re.compile(text)
        re.compile(f"(?:{scope_flags(text)})")  # whole words are found by a regex around it
    except (re.error, RecursionError, OverflowError) as error:
        raise ValueError(f"it is not a valid regular expression: {error}") from None
    return text


@lru_cache(maxsize=1024)
def expect_quick(pattern: str) -> None:
    """Raise SlowRegexError if a regex breaks the rule above."""
    if pattern != ANY_LABEL:
        pattern = pattern.removeprefix(ANY_LABEL)
        pattern = pattern if pattern.endswith("\\.*") else pattern.removesuffix(ANY_LABEL)
    ways, endless = _cost(import_module("re._parser").parse(pattern))
    if endless > 1:
        raise SlowRegexError("two repeats have no limit; write a limit, as in .{0,50}")
    if ways > (MOST_BESIDE_ENDLESS if endless else MOST_WAYS):
        raise SlowRegexError("there are too many ways to match one text; use fewer repeats and choices")


def _cost(tree: Any) -> tuple[int, int]:  # noqa: ANN401 - of private classes of `re`
    """In how many ways a part of a regex may match one text, and how many repeats without limit it has."""
    costs = [(str(op), *_cost_of(str(op), value)) for op, value in tree]
    # Nothing goes back into what looks ahead or behind: its cost comes beside that of the rest.
    looks = [(ways, endless) for op, ways, endless in costs if op in LOOK_OPCODES]
    rest = [(ways, endless) for op, ways, endless in costs if op not in LOOK_OPCODES]
    return (
        prod(ways for ways, _ in rest) + sum(ways for ways, _ in looks),
        max(sum(endless for _, endless in rest), *(endless for _, endless in looks), 0),
    )


def _cost_of(op: str, value: Any) -> tuple[int, int]:  # noqa: ANN401 - the same
    if op in UNSUPPORTED_OPCODES:
        raise SlowRegexError("it refers to one of its groups; write out what you mean")
    if op in REPEAT_OPCODES:
        return _cost_of_repeat(*value)
    if op == "BRANCH":
        costs = [_cost(choice) for choice in value[1]]
        return sum(ways for ways, _ in costs), max(endless for _, endless in costs)
    if op == "ATOMIC_GROUP":
        return _cost(value)
    return _cost(value[-1]) if op in GROUPS else (1, 0)


def _cost_of_repeat(least: int, most: int, repeated: Any) -> tuple[int, int]:  # noqa: ANN401 - the same
    if most <= 1:
        ways, endless = _cost(repeated)
        return 1 + ways, endless
    if [str(op) for op, _ in repeated][1:] or str(repeated[0][0]) not in SINGLE:
        raise SlowRegexError("a repeat holds more than one character; write out how often it may be there")
    return (1, 1) if most > ENDLESS_REPEATS else (most - least + 1, 0)
