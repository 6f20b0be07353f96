"""The formulas of RTL as values that print as the text in which people write them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, TypeAlias

from codebotler.core.cachedproperty import cached_property
from codebotler.rtl.pattern import compile_regex, quote, whole_word
from codebotler.rtl.text.claims import Claim, Number, Time

CutName: TypeAlias = Literal["BeforeFirst", "BeforeLast", "AfterFirst", "AfterLast"]


@dataclass(frozen=True)
class Regex:
    """A text in which a regex is found, ignoring case.

    Args:
        pattern: the regex; `.` is any character, a line break too.
    """

    pattern: str

    @cached_property
    def compiled(self) -> re.Pattern[str]:
        """The regex, ready to search with."""
        return compile_regex(self.pattern)

    def matches(self, text: str) -> bool:
        """Whether the regex is found in a text."""
        return self.compiled.search(text) is not None

    def __str__(self) -> str:
        return quote(self.pattern)


@dataclass(frozen=True)
class Without:
    """A text in which a regex is not found as a whole word.

    Args:
        pattern: the regex.
    """

    pattern: str

    @cached_property
    def compiled(self) -> re.Pattern[str]:
        """The regex between word boundaries, ready to search with."""
        return whole_word(self.pattern)

    def matches(self, text: str) -> bool:
        """Whether the regex is nowhere in a text, or only inside words."""
        return self.compiled.search(text) is None

    def __str__(self) -> str:
        return f"without({quote(self.pattern)})"


@dataclass(frozen=True)
class Words:
    """A text in which all parts are found, in any order.

    Args:
        parts: one or more texts.
    """

    parts: tuple[Text, ...]

    def matches(self, text: str) -> bool:
        """Whether every part is found somewhere in a text."""
        return all(part.matches(text) for part in self.parts)

    def __str__(self) -> str:
        return f"words({', '.join(map(str, self.parts))})"


Text: TypeAlias = Regex | Words | Without | Number | Time | Claim


@dataclass(frozen=True)
class EventPattern:
    """What an event may be: a kind with a text and, for a question, an option.

    Args:
        kind: the kind of the event, such as `goto`.
        text: what the event's text must match; for a mention, the question or one of its options.
        options: what at least one option must match; None for kinds without options, and for a mention.
        mention: whether it is a question that has the text anywhere, also among its options.
        place: a regex for the room in which it must happen, found there as a whole word; None for anywhere.
        answer: what the option that was chosen must match; None where no answer is meant.
    """

    kind: str
    text: Text
    options: Text | None = None
    mention: bool = False
    place: str | None = None
    answer: Text | None = None

    @cached_property
    def is_place(self) -> re.Pattern[str] | None:
        """The regex for the room, ready to search with."""
        return None if self.place is None else whole_word(self.place)

    def happens_at(self, room: str) -> bool:
        """Whether what happens in a room may be meant."""
        return self.is_place is None or self.is_place.search(room) is not None

    def __str__(self) -> str:
        texts = [self.text] if self.options is None else [self.text, self.options]
        told = f"{'mention' if self.mention else self.kind}({', '.join(map(str, texts))})"
        if self.answer is not None:
            told = f"answered({self.answer})"
        return told if self.place is None else f"at({quote(self.place)}, {told})"


@dataclass(frozen=True)
class Scope:
    """A part of a trace: what lies before or after the first or last event that an element matches.

    Args:
        name: which part.
        element: what is searched for; where nothing matches, the trace stays whole.
    """

    name: CutName
    element: EventPattern

    def __str__(self) -> str:
        return f".{self.name}({self.element})"


Cuts: TypeAlias = tuple[Scope, ...]


@dataclass(frozen=True)
class Exists:
    """Some event of the trace matches.

    Args:
        element: what the event must match.
        cuts: how the trace is cut before, in order.
    """

    element: EventPattern
    cuts: Cuts = ()

    def __str__(self) -> str:
        return f"{_cut_trace(self.cuts)}.Exists({self.element})"


@dataclass(frozen=True)
class _ActAtPlace:
    """An event matches during a stay at a place.

    Args:
        place: a regex for the room.
        element: what the event must match.
        cuts: how the trace is cut before, in order.
    """

    place: str
    element: EventPattern
    cuts: Cuts = ()

    @cached_property
    def stay(self) -> Stay:
        """The moves that begin and end a stay at the place."""
        return Stay.at(self.place)

    def __str__(self) -> str:
        return f"{_cut_trace(self.cuts)}.{type(self).__name__}({quote(self.place)}, {self.element})"


class ActAtFirst(_ActAtPlace):
    """An event matches during the first stay at a place."""


class ActAtSome(_ActAtPlace):
    """An event matches during some stay at a place."""


@dataclass(frozen=True)
class _Counting:
    """How many events of the trace match.

    Args:
        element: what the events must match.
        number: how many, 0 or more.
        cuts: how the trace is cut before, in order.
    """

    element: EventPattern
    number: int
    cuts: Cuts = ()

    def __str__(self) -> str:
        return f"{_cut_trace(self.cuts)}.{type(self).__name__}({self.element}, {self.number})"


class Count(_Counting):
    """Exactly so many events of the trace match."""


class AtLeast(_Counting):
    """So many events of the trace match, or more."""


@dataclass(frozen=True)
class And:
    """All parts hold.

    Args:
        parts: two or more, evaluated from the left until one fails.
    """

    parts: tuple[Formula, ...]

    def __str__(self) -> str:
        return " and ".join(_part(part, (And, Or)) for part in self.parts)


@dataclass(frozen=True)
class Or:
    """Some part holds.

    Args:
        parts: two or more, evaluated from the left until one holds.
    """

    parts: tuple[Formula, ...]

    def __str__(self) -> str:
        return " or ".join(_part(part, (Or,)) for part in self.parts)


@dataclass(frozen=True)
class Not:
    """A formula does not hold.

    Args:
        part: the formula.
    """

    part: Formula

    def __str__(self) -> str:
        return f"not {_part(self.part, (And, Or))}"


Test: TypeAlias = Exists | ActAtFirst | ActAtSome | Count | AtLeast
Formula: TypeAlias = Test | And | Or | Not


@dataclass(frozen=True)
class Stay:
    """A stay at a place.

    Args:
        arrival: the move that begins it.
        departure: the move that ends it.
    """

    arrival: EventPattern
    departure: EventPattern

    @classmethod
    def at(cls, place: str) -> Stay:
        """A stay at the place that a regex names."""
        return cls(EventPattern("goto", Regex(place)), EventPattern("goto", Without(place)))


def _cut_trace(cuts: Cuts) -> str:
    return "tr" + "".join(map(str, cuts))


def _part(formula: Formula, bracketed: tuple[type[Formula], ...]) -> str:
    return f"({formula})" if isinstance(formula, bracketed) else str(formula)
