"""Regexes and functions whose time grows faster than the text they read, found by measuring."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import product, takewhile
from random import Random
from typing import Any, NamedTuple

from codebotler.rtl.pattern import Tree, compile_regex, parse_tree
from codebotler.rtl.reasoning.regex_samples import failing, inner_trees, spelled

SIZES = (10, 14, 20, 28, 100, 300, 1_000, 10_000)  # of texts, in characters
FACTOR = 3  # how much longer one text is than another, about
LINEAR = 1.8  # times as long as a text so much longer should take; 3 would be quadratic

FLOOR = 0.001  # seconds below which a measurement says nothing
WIDE, CLEAR = 100, 0.005  # the same from so many characters on: what looks at a few around each is linear
ENOUGH = 0.02  # seconds beyond which no longer text is needed
LONG = 0.1  # seconds beyond which a measurement is hardly disturbed
TRIES = 10  # of a shorter one that seems to be superlinear
MOST = 40  # texts that are tried with a regex
MANY, ONCE = 50, 1  # repetitions from which a repeat counts as endless, and as one at all

SHORT_SIZES = range(4, 41, 2)  # of texts that no regex should need long for, in characters
TOO_LONG = 0.01  # seconds; those of the suites and of usual rules take less than a hundredth of that

FILLERS = (" ", "\n", "1", "a", "a ", "1 ", "a, ", "-", ",", "'", "no ", "not ")
SUFFIXES = ("", "\0 x y z x y z")
BLOCKS = 5


class Attack(NamedTuple):
    """A text of any length that may take a regex long."""

    prefix: str
    unit: str  # follows the prefix, again and again
    suffix: str = ""
    blocks: int = 1  # how often prefix and units come before the suffix

    def text(self, size: int) -> str:
        """The text with about `size` characters."""
        block = self.prefix + self.unit * max(1, size // len(self.unit) // self.blocks)
        return block * self.blocks + self.suffix


def is_superlinear(read: Callable[[str], object], attack: Attack) -> bool:
    """Whether a function takes more than linear time to read a text as it grows."""
    for size in SIZES:
        short, long = attack.text(size // FACTOR), attack.text(size)
        most = LINEAR * len(long) / len(short)
        spent = _seconds(read, long)
        floor = FLOOR if size < WIDE else CLEAR
        if spent < floor:
            continue
        before = _seconds(read, short)
        for _ in range(TRIES if spent < LONG else 2):  # the machine may have been busy
            if spent <= max(floor, most * before):
                break
            before = min(before, _seconds(read, short))
            spent = min(spent, _seconds(read, long))
        else:
            if spent > max(floor, most * before):
                return True
        if spent > ENOUGH:
            return False
    return False


def _seconds(read: Callable[[str], object], text: str) -> float:
    start = time.thread_time()
    read(text)
    return time.thread_time() - start


@cache
def slow_text(pattern: str) -> Attack | None:
    """A text on which finding a regex takes more than linear time; None if none was found."""
    every = failing(pattern).findall
    for attack in sampled_attacks(pattern, ONCE):
        if explodes(every, attack):
            return attack
    find = compile_regex(pattern).findall
    return next((attack for attack in sampled_attacks(pattern) if is_superlinear(find, attack)), None)


def explodes(read: Callable[[str], object], attack: Attack) -> bool:
    """Whether a function that finds nothing takes long to read even a short text.

    What is bounded, such as `(?:a|aa){40}b`, takes no longer from some length on, but seconds until then.
    """
    for size in SHORT_SIZES:
        text = attack.text(size)[:size]
        if (spent := _seconds(read, text)) > TOO_LONG and min(spent, _seconds(read, text)) > TOO_LONG:
            return True
    return False


def sampled_attacks(pattern: str, repeated: int = MANY) -> list[Attack]:
    """Some texts that may take a regex long, the same each time, from what it may repeat so many times."""
    every = [*_attacks(pattern, repeated)]
    return Random(pattern).sample(every, min(MOST, len(every)))  # noqa: S311 - no secret


def _attacks(pattern: str, repeated: int) -> Iterator[Attack]:
    """Near misses that repeat what the regex repeats; none if it repeats nothing."""
    tree = parse_tree(pattern)
    repeats = [*_repeats(list(tree), ("",), repeated)]
    units = dict.fromkeys(unit for _, several in repeats for unit in several)
    if not units:
        return
    pairs = dict.fromkeys(
        (prefix, unit)
        for prefixes, several in repeats
        for prefix in dict.fromkeys(["", *prefixes])
        for unit in dict.fromkeys([*several, *(prefix + one for one in (*several, " ") if prefix)])
    )
    pairs.update(dict.fromkeys(product([""], [*FILLERS, *filter(None, spelled(tree)[:3])])))
    suffixes = [*SUFFIXES, *(f" {text}" for text in _denied(tree))]
    yield from (Attack(*pair, suffix) for pair in pairs for suffix in suffixes)
    yield from (Attack(*pair, SUFFIXES[-1], BLOCKS) for pair in pairs if pair[0])


def _repeats(
    items: Sequence[Tree], before: Sequence[str], repeated: int
) -> Iterator[tuple[Sequence[str], list[str]]]:
    """For each repeat of so many times: texts that lead to it, and units that it may repeat."""
    for at, (op, value) in enumerate(items):
        if (inner := _repeated(str(op), value, repeated)) is not None:
            several = [unit for unit in spelled(inner)[:3] if unit]
            behind = _until_next_repeat(items[at + 1 :])
            yield before, [*several, *(unit + more for unit in several[:1] for more in behind)]
        for part in inner_trees(str(op), value):
            yield from _repeats(list(part), before, repeated)
        following = [text for text in spelled([(op, value)]) if text][:2] or [""]
        before = [*dict.fromkeys(one + other for one in before for other in following)][:2]


def _until_next_repeat(items: Sequence[Any]) -> list[str]:
    until = [*takewhile(lambda item: _repeated(str(item[0]), item[1], MANY) is None, items)]
    return [*dict.fromkeys(filter(None, (*spelled(until)[:2], *spelled(until, " ")[:2])))]


def _denied(items: Sequence[Any]) -> Iterator[str]:
    """Texts of negative assertions, which make a search fail at the end of a text."""
    for op, value in items:
        if str(op) == "ASSERT_NOT":
            yield from spelled(value[-1], " ")[-1:]
        for part in inner_trees(str(op), value):
            yield from _denied(part)


def _repeated(op: str, value: Any, repeated: int) -> Tree | None:  # noqa: ANN401 - as Python's parser made it
    return value[2] if op in ("MAX_REPEAT", "MIN_REPEAT") and value[1] >= repeated else None
