"""Regexes that take long to search one of the texts that a program may say, found by trying."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from random import Random
from typing import NamedTuple

from codebotler.rtl.pattern import Tree, compile_regex, parse_tree
from codebotler.rtl.reasoning.regex_samples import failing_regex, inner_trees, spell_out

SHORT_SIZES = range(4, 41, 2)  # characters; small steps, since time may double with each character
LONG_SIZES = (100, 300, 1_000, 3_000, 10_000)  # characters, up to the longest text that a program may say
SLOW_SECONDS = (
    0.05  # seconds; of 10,000 characters, linear searches take up to 0.01 and quadratic ones from 0.2
)
MAX_TRIED_TEXTS = 120  # texts for each regex
UNITS = (" ", "\n", "1", "a", "a ", "1 ", "a, ", "-", ",", "'", "no ", "not ")
SUFFIXES = ("", "\0 x y z")


class RepeatedText(NamedTuple):
    """A text of any length."""

    unit: str
    prefix: str = ""
    suffix: str = ""

    def of(self, size: int) -> str:
        """The text with so many characters before the suffix."""
        return (self.prefix + self.unit * (size // len(self.unit) + 1))[:size] + self.suffix


@cache
def slow_text(pattern: str) -> str | None:
    """The beginning of a text that takes a regex too long to search; None if none was found."""
    for find, sizes in ((failing_regex(pattern), SHORT_SIZES), (compile_regex(pattern), LONG_SIZES)):
        for text in texts_to_try(pattern):
            if is_slow(find.findall, text, sizes):
                return text.prefix + text.unit * 3
    return None


def is_slow(
    read: Callable[[str], object],
    text: RepeatedText,
    sizes: Sequence[int] = (*SHORT_SIZES, *LONG_SIZES),
    seconds: float = SLOW_SECONDS,
) -> bool:
    """Whether a function takes more seconds of processor time to read a text of one of the sizes."""
    for size in sizes:
        spent = _seconds(read, text.of(size))
        if spent > seconds:  # perhaps since the machine was busy
            spent = _seconds(read, text.of(size))
        if spent > seconds:
            return True
        if (
            size == LONG_SIZES[-2] and spent < seconds / 10
        ):  # a quadratic search of the longest takes 10 times this
            return False
    return False


@cache
def texts_to_try(pattern: str) -> list[RepeatedText]:
    """Some texts that may take a regex long, always the same ones; none if it repeats nothing."""
    tree = parse_tree(pattern)
    if "REPEAT" not in str(tree):
        return []
    parts = [*dict.fromkeys(filter(None, _fragments(tree)))]
    choices, choose = ([*parts, *UNITS], ["", *parts], SUFFIXES), Random(pattern).choice  # noqa: S311 - no secret
    return [*dict.fromkeys(RepeatedText(*map(choose, choices)) for _ in range(MAX_TRIED_TEXTS))]


def _seconds(read: Callable[[str], object], text: str) -> float:
    start = time.thread_time()
    read(text)
    return time.thread_time() - start


def _fragments(tree: Tree) -> Iterator[str]:
    """Some texts that a regex, its beginnings and its parts match."""
    items = list(tree)
    for end, (op, arguments) in enumerate(items, 1):
        for part in (items[:end], items[end - 1 : end]):
            yield from (*spell_out(part)[:2], *spell_out(part, " ")[:2])
        for inner in inner_trees(str(op), arguments):
            yield from _fragments(inner)
