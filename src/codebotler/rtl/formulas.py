"""The formulas of RTL as immutable objects. `str` writes a formula, and `parse` reads it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from types import UnionType
from typing import Literal, TypeAlias

from codebotler.core.cachedproperty import cached_property
from codebotler.core.skills.kinds import CHECK, GOTO
from codebotler.rtl.pattern import Matcher, compile_regex, quote, whole_word
from codebotler.rtl.text.claims import Claim, Number, Time

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
    """Matches texts in which a regex is found. Case is ignored, and `.` also matches line breaks."""

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
    """Matches texts in which a regex is not found as a whole word."""

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
    """Matches texts that all parts match, in any order: `words("tea", "milk")` matches `milk or tea`."""

    parts: tuple[TextPattern, ...]

    def _matches(self, text: str) -> bool:
        return all(part.matches(text) for part in self.parts)

    def __str__(self) -> str:
        return f"words({', '.join(map(str, self.parts))})"


TextPattern: TypeAlias = Regex | Words | Without | Number | Time | Claim


@dataclass(frozen=True)
class EventPattern:
    """A pattern for events of one kind, such as `goto("lobby")` or `ask("tea", "yes")`.

    Args:
        kind: the kind of event, such as `goto`.
        text: matches the event's text.
        options: matches at least one option of a question; None for any options.
        mention: whether `text` may match an option instead of the question.
        place: a regex to find as a whole word in the room's name; None for any room.
        answer: matches the answer to a question; None for any answer.
        found: the result of a look or another yes-or-no skill; None for any result.
        holding: matches what the robot held at the start of the event; None for anything.
        to: matches the addressee of a question; None for anyone.
        more: match further arguments, in order.
        has_text: whether events of this kind have a text; False if their skill has no parameters.
        means: words that explain its texts, such as `that nobody is coming`; None to show the texts.
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
    has_text: bool = True
    means: str | None = field(default=None, compare=False)

    @cached_property
    def place_regex(self) -> re.Pattern[str] | None:
        """The compiled regex for the room's name, or None if the pattern matches in any room."""
        return None if self.place is None else whole_word(self.place)

    @cached_property
    def is_about_more(self) -> bool:
        """Whether the pattern looks at the answer, result, held object, addressee or further arguments."""
        wanted = self.answer, self.found, self.holding, self.to
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
        if self.holding is not None:
            written = f"holding({self.holding}, {written})"
        return written if self.place is None else f"at({quote(self.place)}, {written})"


@dataclass(frozen=True)
class Scope:
    """The part of a trace before or after the first or last matching event.

    Args:
        name: which part, such as `AfterFirst`; the part excludes the event itself.
        element: the pattern of the event. If no event matches, the scope is the whole trace, or is empty if
            `name` begins with `Only`.
    """

    name: ScopeName
    element: EventPattern

    @property
    def is_only(self) -> bool:
        """Whether the scope is empty if no event matches."""
        return self.name.startswith("Only")

    @property
    def is_before(self) -> bool:
        """Whether the scope is the part before the event, not the part after the event."""
        return "Before" in self.name

    def __str__(self) -> str:
        return f".{self.name}({self.element})"


@dataclass(frozen=True)
class _OfEvent:
    """The base class of tests for one event in nested scopes."""

    element: EventPattern
    scopes: tuple[Scope, ...] = ()

    def __str__(self) -> str:
        return f"{_scoped(self.scopes)}.{type(self).__name__}({self.element})"


class Exists(_OfEvent):
    """Holds if some event within the scopes matches `element`."""


class Last(_OfEvent):
    """Holds if the last event within the scopes matches `element`. Fails if there are no events."""


@dataclass(frozen=True)
class _ActAtPlace:
    """The base class of tests for an event during a stay in a room whose name matches the regex `place`."""

    place: str
    element: EventPattern
    scopes: tuple[Scope, ...] = ()

    @cached_property
    def arrival(self) -> EventPattern:
        """The pattern of the move that begins a stay."""
        return EventPattern(GOTO, Regex(self.place))

    @cached_property
    def departure(self) -> EventPattern:
        """The pattern of the move that ends a stay."""
        return EventPattern(GOTO, Without(self.place))

    def __str__(self) -> str:
        return f"{_scoped(self.scopes)}.{type(self).__name__}({quote(self.place)}, {self.element})"


class ActAtFirst(_ActAtPlace):
    """Holds if an event matches `element` during the robot's first stay at `place`."""

    @cached_property
    def stay(self) -> tuple[Scope, ...]:
        """The scopes of this test, and two more that limit it to the first stay."""
        bounds = Scope("OnlyAfterFirst", self.arrival), Scope("BeforeFirst", self.departure)
        return (*self.scopes, *bounds)


class ActAtSome(_ActAtPlace):
    """Holds if an event matches `element` during any of the robot's stays at `place`."""


@dataclass(frozen=True)
class _Counting:
    """The base class of tests that count matching events."""

    element: EventPattern
    number: int
    scopes: tuple[Scope, ...] = ()

    def __str__(self) -> str:
        return f"{_scoped(self.scopes)}.{type(self).__name__}({self.element}, {self.number})"


class Count(_Counting):
    """Holds if exactly `number` events within the scopes match `element`."""


class AtLeast(_Counting):
    """Holds if at least `number` events within the scopes match `element`."""


@dataclass(frozen=True)
class And:
    """Conjunction: holds if all of its parts hold. Evaluation stops at the first part that fails."""

    parts: tuple[Formula, ...]

    def __str__(self) -> str:
        return " and ".join(_bracketed(part, And | Or) for part in self.parts)


@dataclass(frozen=True)
class Or:
    """Disjunction: holds if any of its parts holds. Evaluation stops at the first part that holds."""

    parts: tuple[Formula, ...]

    def __str__(self) -> str:
        return " or ".join(_bracketed(part, Or) for part in self.parts)


@dataclass(frozen=True)
class Not:
    """Negation: holds if the given formula does not."""

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
