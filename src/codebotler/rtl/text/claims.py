"""What a text claims: how many there are of a thing, a time of day, and what it affirms or denies."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from codebotler.core.cachedproperty import cached_property
from codebotler.rtl.pattern import compile_regex, quote, whole_word
from codebotler.rtl.text.clauses import clauses, sentences
from codebotler.rtl.text.numbers import numerals
from codebotler.rtl.text.polarity import Polarity, polarity, without_harmless
from codebotler.rtl.text.times import TimeOfDay, times_in


@dataclass(frozen=True)
class Number:
    """A text that gives a number of a thing.

    Args:
        number: how many.
        thing: a regex for it, found as a whole word; in the plural, too.
        others: regexes for other things, whose numbers are not meant.
        other: whether the text must give another number of the thing instead.
    """

    number: int
    thing: str
    others: tuple[str, ...] = ()
    other: bool = False

    def matches(self, text: str) -> bool:
        """Whether the text gives just this number of the thing; or, if that is wanted, another."""
        given = self.given(text)
        return bool(given) and (given != {self.number}) == self.other

    def given(self, text: str) -> frozenset[float]:
        """All numbers that a text gives of the thing.

        In each clause a number belongs to the thing next to it: the one that follows, or, where things come
        first, the one before. A text that does not name the thing gives all numbers that belong to no other.
        """
        return _given(self.kinds, text)

    @cached_property
    def kinds(self) -> tuple[re.Pattern[str], ...]:
        """The regexes for the thing and the others, ready to search with."""
        return tuple(map(_word, (self.thing, *self.others)))

    def __str__(self) -> str:
        head = "othernumber" if self.other else "number"
        return f"{head}({', '.join([str(self.number), *map(quote, (self.thing, *self.others))])})"


@lru_cache(maxsize=256)  # several checks ask for other numbers of the same thing
def _given(kinds: tuple[re.Pattern[str], ...], text: str) -> frozenset[float]:
    told = [sentence for sentence in sentences(without_harmless(text)) if not sentence.endswith("?")]
    parts = [[*_marks(clause, kinds)] for sentence in told for clause in clauses(sentence)]
    if not any(kind == 0 for part in parts for kind, _ in part):
        no_other = (part for part in parts if not any(kind for kind, _ in part))
        return frozenset(n for part in no_other for _, numbers in part for n in numbers)
    found = frozenset(n for part in parts for n in _paired(part))
    return found or frozenset(n for sentence in told for n in _paired([*_marks(sentence, kinds)]))


def _word(pattern: str) -> re.Pattern[str]:
    """A regex as a whole word, in the singular or the plural; what is no word, such as `%`, may touch one."""
    return compile_regex(rf"(?:\b|(?=\W))(?:{pattern})(?:e?s)?(?:\b|(?<=\W))")


Mark = tuple[int | None, tuple[float, ...]]
"""A thing, by its number, with no numbers; or None with the numbers that stand together."""


def _marks(text: str, kinds: tuple[re.Pattern[str], ...]) -> Iterator[Mark]:
    """The things and numbers in a text, in their order; no number is part of the name of a thing."""
    things = [*_things(text, kinds)]
    starts = [start for start, _, _ in things]
    found: list[tuple[int, Mark]] = [(start, (kind, ())) for start, _, kind in things]
    for start, end, numbers in numerals(text):
        before = bisect_left(starts, end)  # of those that begin before it ends, the last reaches farthest
        if not before or things[before - 1][1] <= start:
            found.append((start, (None, numbers)))
    yield from (mark for _, mark in sorted(found, key=lambda one: one[0]))


def _things(text: str, kinds: tuple[re.Pattern[str], ...]) -> Iterator[tuple[int, int, int]]:
    """Where which thing is named; of names within others, or of equal ones, the longest that stands first."""
    named = [
        (match.start(), -match.end(), kind)
        for kind, regex in enumerate(kinds)
        for match in regex.finditer(text)
    ]
    reached = -1
    for start, end, kind in sorted(named):
        if -end > reached:
            reached = -end
            yield start, -end, kind


def _paired(marks: list[Mark]) -> Iterator[float]:
    """The numbers that belong to the thing: numbers before things, or after, whichever comes first."""
    ordered = marks if marks and marks[0][0] is None else marks[::-1]
    numbers: tuple[float, ...] = ()
    for kind, given in ordered:
        if kind is None:
            numbers = given
        else:
            yield from numbers if kind == 0 else ()
            numbers = ()


@dataclass(frozen=True)
class Time:
    """A text that names times of day.

    Args:
        start: the earliest, as `11:00`.
        end: the latest.
        other: whether some time that is named must lie outside instead; else all lie between the two.
    """

    start: str
    end: str
    other: bool = False

    def matches(self, text: str) -> bool:
        """Whether times are named, and lie between the two; or, if that is wanted, some do not.

        A time that may be in the morning or in the afternoon is the one that lies between the two.
        """
        named = times_in(text)
        inside = [
            any(self._minutes[0] <= time <= self._minutes[1] for time in readings) for readings in named
        ]
        return not all(inside) if self.other else bool(inside) and all(inside)

    @cached_property
    def _minutes(self) -> tuple[TimeOfDay, TimeOfDay]:
        return minutes(self.start), minutes(self.end)

    def __str__(self) -> str:
        return f"{'othertime' if self.other else 'time'}({quote(self.start)}, {quote(self.end)})"


def minutes(time: str) -> TimeOfDay:
    """A time such as `11:30` in minutes since midnight.

    Args:
        time: hours and minutes.

    Raises:
        ValueError: it is none.
    """
    match = re.fullmatch(r"(\d\d?):(\d\d)", time)
    if match is None or int(match[1]) > 24 or int(match[2]) > 59:  # noqa: PLR2004 - hours and minutes
        raise ValueError(f'"{time}" is no time of day such as "11:30"')
    return int(match[1]) * 60 + int(match[2])


@dataclass(frozen=True)
class Claim:
    """A text in which something is named in a clause that affirms it, or in one that denies something.

    Args:
        pattern: a regex for what is named, found as a whole word.
        denied: whether it must be denied.
    """

    pattern: str
    denied: bool = False

    @cached_property
    def compiled(self) -> re.Pattern[str]:
        """The regex between word boundaries, ready to search with."""
        return whole_word(self.pattern)

    def matches(self, text: str) -> bool:
        """Whether some clause names it and denies something, or affirms it, as is wanted."""
        wanted = Polarity.DENIES if self.denied else Polarity.AFFIRMS
        return any(
            said is wanted and self.compiled.search(clause) is not None for clause, said in _told(text)
        )

    def __str__(self) -> str:
        return f"{'denies' if self.denied else 'affirms'}({quote(self.pattern)})"


@lru_cache(maxsize=64)  # what a robot says is mostly looked at by several checks, one after the other
def _told(text: str) -> tuple[tuple[str, Polarity], ...]:
    """The clauses of a text, and what each does with what it names."""
    parts = (clause for sentence in sentences(text) for clause in clauses(sentence, lists=True))
    return tuple((clause, polarity(clause)) for clause in parts)
