"""The formulas of RTL as immutable values; `str` writes one as text that `parse` reads."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from types import UnionType
from typing import Literal, TypeAlias

from codebotler.core.cachedproperty import cached_property
from codebotler.core.skills.kinds import CHECK, GOTO
from codebotler.rtl.pattern import compile_regex, quote, whole_word
from codebotler.rtl.text.claims import Claim, Number, Time
from codebotler.rtl.text.matcher import Matcher

ScopeName: TypeAlias = Literal[
    "BeforeFirst",
    "BeforeLast",
    "AfterFirst",
    "AfterLast",
    "OnlyBeforeFirst",
    "OnlyBeforeLast",
    "OnlyAfterFirst",
    "OnlyAfterLast",
]


@dataclass(frozen=True)
class Regex(Matcher):
    """A text in which a regex is found, ignoring case.

    Args:
        pattern: the regex; `.` is any character, a line break too.
    """

    pattern: str

    @cached_property
    def compiled(self) -> re.Pattern[str]:
        """The compiled regex."""
        return compile_regex(self.pattern)

    def _matches(self, text: str) -> bool:
        return self.compiled.search(text) is not None

    def __str__(self) -> str:
        return quote(self.pattern)


@dataclass(frozen=True)
class Without(Matcher):
    """A text in which a regex is not found as a whole word.

    Args:
        pattern: the regex.
    """

    pattern: str

    @cached_property
    def compiled(self) -> re.Pattern[str]:
        """The compiled regex, between word boundaries."""
        return whole_word(self.pattern)

    def _matches(self, text: str) -> bool:
        return self.compiled.search(text) is None

    def __str__(self) -> str:
        return f"without({quote(self.pattern)})"


@dataclass(frozen=True)
class Words(Matcher):
    """A text in which all parts are found, in any order.

    Args:
        parts: one or more texts.
    """

    parts: tuple[TextPattern, ...]

    def _matches(self, text: str) -> bool:
        return all(part.matches(text) for part in self.parts)

    def __str__(self) -> str:
        return f"words({', '.join(map(str, self.parts))})"


TextPattern: TypeAlias = Regex | Words | Without | Number | Time | Claim


@dataclass(frozen=True)
class EventPattern:
    """The events of one kind whose text, options, answer and room match.

    Args:
        kind: the kind of the event, such as `goto`.
        text: what the event's text must match.
        options: what at least one option of a question must match; None if options do not matter.
        mention: whether `text` may also be found in an option instead of in the question.
        place: a regex that the room's name must hold as a whole word; None for anywhere.
        answer: what the answer to a question must match; None if the answer does not matter.
        found: whether a look must have succeeded or failed; None if that does not matter.
        holding: what the robot must have held when it began; None if that does not matter.
        to: what the person must match whom a question was for; None if that does not matter.
        more: what the further arguments of a skill that has several must match, in order.
        offers: how many options a question must offer, at least and at most; None for any number.
        has_text: whether such events have a text: False if their skill has no arguments.
        means: what its texts come to, after the verb in a sentence, such as `that nobody is coming`; None
            where the texts are plain enough.
    """

    kind: str
    text: TextPattern
    options: TextPattern | None = None
    mention: bool = False
    place: str | None = None
    answer: TextPattern | None = None
    found: bool | None = None
    holding: TextPattern | None = None
    to: TextPattern | None = None
    more: tuple[TextPattern, ...] = ()
    offers: tuple[int, int | None] | None = None
    has_text: bool = True
    means: str | None = field(default=None, compare=False)

    @cached_property
    def place_regex(self) -> re.Pattern[str] | None:
        """The compiled regex for the room."""
        return None if self.place is None else whole_word(self.place)

    @cached_property
    def is_about_more(self) -> bool:
        """Whether more than the texts and the room matters."""
        wanted = self.answer, self.found, self.holding, self.to, self.offers
        return bool(self.more) or any(one is not None for one in wanted)

    def __str__(self) -> str:
        if self.answer is not None:
            written = f"answered({self.answer})"
        elif self.found is not None and self.kind == CHECK:
            written = f"{'found' if self.found else 'missed'}({self.text})"
        else:
            texts = [self.text, *self.more] if self.options is None else [self.text, self.options]
            if not self.has_text:
                texts = []
            written = f"{'mention' if self.mention else self.kind}({', '.join(map(str, texts))})"
        if self.found is not None and self.kind != CHECK:
            written = f"returned({self.found}, {written})"
        if self.to is not None:
            written = f"to({self.to}, {written})"
        if self.offers is not None:
            numbers = (str(number) for number in self.offers if number is not None)
            written = f"options({', '.join(numbers)}, {written})"
        if self.holding is not None:
            written = f"holding({self.holding}, {written})"
        return written if self.place is None else f"at({quote(self.place)}, {written})"


@dataclass(frozen=True)
class Scope:
    """The part of a trace before or after the first or last event that an element matches.

    Args:
        name: which part; the event itself is in none.
        element: the event that bounds the part; where none matches, the scope is the whole trace, or nothing
            if the name begins with `Only`.
    """

    name: ScopeName
    element: EventPattern

    @property
    def is_only(self) -> bool:
        """Whether nothing is left where no event matches."""
        return self.name.startswith("Only")

    @property
    def is_before(self) -> bool:
        """Whether it is the part before the event."""
        return "Before" in self.name

    def __str__(self) -> str:
        return f".{self.name}({self.element})"


@dataclass(frozen=True)
class _OfEvent:
    """About one event.

    Args:
        element: what the event must match.
        scopes: where to look, each within the one before.
    """

    element: EventPattern
    scopes: tuple[Scope, ...] = ()

    def __str__(self) -> str:
        return f"{_scoped(self.scopes)}.{type(self).__name__}({self.element})"


class Exists(_OfEvent):
    """Some event matches."""


class Last(_OfEvent):
    """There is a last event, and it matches."""


@dataclass(frozen=True)
class _ActAtPlace:
    """An event matches during a stay at a place.

    Args:
        place: a regex for the room.
        element: what the event must match.
        scopes: where to look, each within the one before.
    """

    place: str
    element: EventPattern
    scopes: tuple[Scope, ...] = ()

    @cached_property
    def arrival(self) -> EventPattern:
        """The move that begins a stay."""
        return EventPattern(GOTO, Regex(self.place))

    @cached_property
    def departure(self) -> EventPattern:
        """The move that ends a stay."""
        return EventPattern(GOTO, Without(self.place))

    def __str__(self) -> str:
        return f"{_scoped(self.scopes)}.{type(self).__name__}({quote(self.place)}, {self.element})"


class ActAtFirst(_ActAtPlace):
    """An event matches during the first stay at a place."""


class ActAtSome(_ActAtPlace):
    """An event matches during some stay at a place."""


@dataclass(frozen=True)
class _Counting:
    """How many events match.

    Args:
        element: what the events must match.
        number: how many, 0 or more.
        scopes: where to look, each within the one before.
    """

    element: EventPattern
    number: int
    scopes: tuple[Scope, ...] = ()

    def __str__(self) -> str:
        return f"{_scoped(self.scopes)}.{type(self).__name__}({self.element}, {self.number})"


class Count(_Counting):
    """Exactly so many events match."""


class AtLeast(_Counting):
    """So many events match, or more."""


@dataclass(frozen=True)
class And:
    """All parts hold.

    Args:
        parts: two or more, evaluated from the left until one fails.
    """

    parts: tuple[Formula, ...]

    def __str__(self) -> str:
        return " and ".join(_bracketed(part, And | Or) for part in self.parts)


@dataclass(frozen=True)
class Or:
    """Some part holds.

    Args:
        parts: two or more, evaluated from the left until one holds.
    """

    parts: tuple[Formula, ...]

    def __str__(self) -> str:
        return " or ".join(_bracketed(part, Or) for part in self.parts)


@dataclass(frozen=True)
class Not:
    """A formula does not hold.

    Args:
        part: the formula.
    """

    part: Formula

    def __str__(self) -> str:
        return f"not {_bracketed(self.part, And | Or)}"


PresenceTest: TypeAlias = Exists | Last | ActAtFirst | ActAtSome
Test: TypeAlias = PresenceTest | Count | AtLeast
Formula: TypeAlias = Test | And | Or | Not


def _scoped(scopes: tuple[Scope, ...]) -> str:
    return "tr" + "".join(map(str, scopes))


def _bracketed(formula: Formula, kinds: type | UnionType) -> str:
    return f"({formula})" if isinstance(formula, kinds) else str(formula)
