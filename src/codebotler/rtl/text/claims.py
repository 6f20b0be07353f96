"""Text patterns for claims: numbers, times of day, affirmations and denials."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from codebotler.core.cachedproperty import cached_property
from codebotler.core.text.labels import scope_flags
from codebotler.rtl.pattern import Matcher, compile_regex, quote, whole_word
from codebotler.rtl.text.clauses import clauses, complete_clauses, sentences
from codebotler.rtl.text.numbers import numerals
from codebotler.rtl.text.polarity import Polarity, polarity, without_harmless
from codebotler.rtl.text.times import TimeOfDay, times_in


@dataclass(frozen=True)
class Number(Matcher):
    """Matches texts with one number for a thing, and no other: `number(2, "mug")` matches `there are 2 mugs`.

    Args:
        number: the number.
        thing: a regex for the thing, as a whole word in the singular or the plural.
        others: regexes for other things, whose numbers are ignored.
        other: whether the text must give a different number instead.
    """

    number: int
    thing: str
    others: tuple[str, ...] = ()
    other: bool = False

    def _matches(self, text: str) -> bool:
        given = self.given(text)
        return bool(given) and (given != {self.number}) == self.other

    def given(self, text: str) -> frozenset[float]:
        """Return all numbers that a string gives for the thing.

        A number belongs to the thing after it or, in clauses that begin with a thing, to the thing before it.
        If a string does not name the thing, all numbers that belong to no other thing count.
        """
        return _given(self.kinds, text)

    @cached_property
    def kinds(self) -> tuple[re.Pattern[str], ...]:
        """The compiled regexes: first for the thing, then for the others."""
        return tuple(map(_word, (self.thing, *self.others)))

    def __str__(self) -> str:
        head = "othernumber" if self.other else "number"
        return f"{head}({', '.join([str(self.number), *map(quote, (self.thing, *self.others))])})"


@lru_cache(maxsize=256)  # several formulas compare numbers of the same thing
def _given(kinds: tuple[re.Pattern[str], ...], text: str) -> frozenset[float]:
    stated = [sentence for sentence in sentences(without_harmless(text)) if not sentence.endswith("?")]
    parts = [[*_marks(clause, kinds)] for sentence in stated for clause in clauses(sentence)]
    if not any(kind == 0 for part in parts for kind, _ in part):
        no_other = (part for part in parts if not any(kind for kind, _ in part))
        return frozenset(n for part in no_other for _, numbers in part for n in numbers)
    found = frozenset(n for part in parts for n in _numbers_of_thing(part))
    return found or frozenset(n for sentence in stated for n in _numbers_of_thing([*_marks(sentence, kinds)]))


# "2 people in the offices" does not mean 2 offices.
_PLACE = re.compile(
    r"\b(?:(?:in|at|from|across|around) (?:(?:all|the|their|your|my|our|each|every) ){0,2}"
    r"|(?:all|each|every) (?:the )?)$",
    re.IGNORECASE,
)
_MAX_PLACE_PREFIX = 30  # characters before a thing that are searched for these words


def _word(pattern: str) -> re.Pattern[str]:
    """Compile a regex for whole words, singular or plural. A sign such as `%` may be next to a word."""
    return compile_regex(rf"(?:\b|(?=\W))(?:{scope_flags(pattern)})(?:e?s)?(?:\b|(?<=\W))")


Mark = tuple[int | None, tuple[float, ...]]
"""Either a thing, such as `(0, ())` for the first, or a number, such as `(None, (2.0, 3.0))` for `2 or 3`."""


def _marks(text: str, kinds: tuple[re.Pattern[str], ...]) -> Iterator[Mark]:
    """Yield the things and numbers in a string in order, but not the digits in names of things."""
    things = [*_things(text, kinds)]
    starts = [start for start, _, _ in things]
    found: list[tuple[int, Mark]] = [(start, (kind, ())) for start, _, kind in things]
    for start, end, numbers in numerals(text):
        before = bisect_left(starts, end)  # the last of the earlier things also ends last
        if not before or things[before - 1][1] <= start:
            found.append((start, (None, numbers)))
    yield from (mark for _, mark in sorted(found, key=lambda one: one[0]))


def _things(text: str, kinds: tuple[re.Pattern[str], ...]) -> Iterator[tuple[int, int, int]]:
    """Yield the start, end and index of each thing. Of overlapping names, use the first, then the longest."""
    named = [
        (match.start(), -match.end(), kind)
        for kind, regex in enumerate(kinds)
        for match in regex.finditer(text)
        if kind == 0 or not _PLACE.search(text, max(0, match.start() - _MAX_PLACE_PREFIX), match.start())
    ]
    last_end = -1
    for start, end, kind in sorted(named):
        if -end > last_end:
            last_end = -end
            yield start, -end, kind


def _numbers_of_thing(marks: list[Mark]) -> Iterator[float]:
    """Yield the numbers of the first thing, which are before it or, if a thing comes first, after it."""
    ordered = marks if marks and marks[0][0] is None else marks[::-1]
    numbers: tuple[float, ...] = ()
    for kind, given in ordered:
        if kind is None:
            numbers = given
        else:
            yield from numbers if kind == 0 else ()
            numbers = ()


@dataclass(frozen=True)
class Time(Matcher):
    """Matches texts that name times of day, all of them between `start` and `end`.

    A time such as `3`, which may mean 3:00 or 15:00, counts if one of the two is between them.

    Args:
        start: the earliest time, such as `11:00`.
        end: the latest time.
        other: whether at least one time must be outside instead.
    """

    start: str
    end: str
    other: bool = False

    def _matches(self, text: str) -> bool:
        start, end = self._minutes
        inside = [any(start <= time <= end for time in readings) for readings in times_in(text)]
        return not all(inside) if self.other else bool(inside) and all(inside)

    @cached_property
    def _minutes(self) -> tuple[TimeOfDay, TimeOfDay]:
        return minutes(self.start), minutes(self.end)

    def __str__(self) -> str:
        return f"{'othertime' if self.other else 'time'}({quote(self.start)}, {quote(self.end)})"


def minutes(time: str) -> TimeOfDay:
    """Convert a time such as `11:30` to minutes since midnight, or raise ValueError for any other text."""
    match = re.fullmatch(r"(\d\d?):(\d\d)", time)
    if match is None or int(match[1]) > 24 or int(match[2]) > 59:  # noqa: PLR2004 - hours and minutes
        raise ValueError(f'"{time}" is not a time of day such as "11:30"')
    return int(match[1]) * 60 + int(match[2])


@dataclass(frozen=True)
class Claim(Matcher):
    """Matches texts with a clause such as `there is tea` or, with `denied`, one such as `there is no tea`.

    Args:
        pattern: a regex for the thing, as a whole word.
        denied: whether the clause must deny the thing.
    """

    pattern: str
    denied: bool = False

    @cached_property
    def compiled(self) -> re.Pattern[str]:
        """The compiled regex, between word boundaries."""
        return whole_word(self.pattern)

    def _matches(self, text: str) -> bool:
        wanted = Polarity.DENIES if self.denied else Polarity.AFFIRMS
        return any(self.compiled.search(clause) for clause, found in _polarities(text) if found is wanted)

    def __str__(self) -> str:
        return f"{'denies' if self.denied else 'affirms'}({quote(self.pattern)})"


@lru_cache(maxsize=1024)  # several formulas read the same text
def _polarities(text: str) -> tuple[tuple[str, Polarity], ...]:
    parts = [clause for sentence in sentences(text) for clause in clauses(sentence, lists=True)]
    return tuple((clause, polarity(clause)) for clause in complete_clauses(parts))
