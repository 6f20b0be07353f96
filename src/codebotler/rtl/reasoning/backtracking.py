"""Find regexes that are slow by searching for them in texts that a program may say."""

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
SLOW_SECONDS = 0.05  # linear searches of 10,000 characters take up to 0.01 s, quadratic ones from 0.2 s
MAX_TRIED_TEXTS = 120  # for each regex
UNITS = (" ", "\n", "1", "a", "a ", "1 ", "a, ", "-", ",", "'", "no ", "not ")
SUFFIXES = ("", "\0 x y z")


class RepeatedText(NamedTuple):
    """A text such as `aaa... x` that repeats a unit, and so can have any length."""

    unit: str
    prefix: str = ""
    suffix: str = ""

    def of(self, size: int) -> str:
        """Return the text with the unit repeated so that `size` characters come before the suffix."""
        return (self.prefix + self.unit * (size // len(self.unit) + 1))[:size] + self.suffix


@cache
def slow_text(pattern: str) -> str | None:
    """Return the start of a string on which a regex is slow: `aaa` for `(a+)+b`, or None if none is found."""
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
    """Whether `read` takes more than `seconds` of processor time on the text in one of the `sizes`."""
    for size in sizes:
        duration = _measure(read, text.of(size))
        if duration > seconds and _measure(read, text.of(size)) > seconds:  # the machine may be busy
            return True
        if size == LONG_SIZES[-2] and duration < seconds / 10:  # not quadratic
            return False
    return False


@cache
def texts_to_try(pattern: str) -> list[RepeatedText]:
    """Return texts on which a regex may be slow, the same each time; empty if it has no repetition."""
    tree = parse_tree(pattern)
    if "REPEAT" not in str(tree):
        return []
    parts = [*dict.fromkeys(filter(None, _fragments(tree)))]
    choices, choose = ([*parts, *UNITS], ["", *parts], SUFFIXES), Random(pattern).choice  # noqa: S311 - no secret
    return [*dict.fromkeys(RepeatedText(*map(choose, choices)) for _ in range(MAX_TRIED_TEXTS))]


def _measure(read: Callable[[str], object], text: str) -> float:
    start = time.thread_time()
    read(text)
    return time.thread_time() - start


def _fragments(tree: Tree) -> Iterator[str]:
    items = list(tree)
    for end, (op, arguments) in enumerate(items, 1):
        for part in (items[:end], items[end - 1 : end]):
            yield from (*spell_out(part)[:2], *spell_out(part, " ")[:2])
        for inner in inner_trees(str(op), arguments):
            yield from _fragments(inner)
