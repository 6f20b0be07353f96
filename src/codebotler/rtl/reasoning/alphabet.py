"""Reduce all possible events to a finite set of events that formulas can distinguish."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import product

from codebotler.core.skills.kinds import GOTO
from codebotler.core.trace import Event, Option
from codebotler.rtl.formulas import (
    ActAtFirst,
    ActAtSome,
    And,
    EventPattern,
    Formula,
    Not,
    Or,
    Regex,
    TextPattern,
)
from codebotler.rtl.reasoning.sample_strings import distinct_strings
from codebotler.rtl.semantics import is_match

_MATCH_ANY = Regex("")


def elements(formula: Formula) -> Iterator[EventPattern]:
    """Yield all event patterns of a formula in order, including those of moves that begin or end a stay."""
    match formula:
        case And(parts) | Or(parts):
            for part in parts:
                yield from elements(part)
        case Not(part):
            yield from elements(part)
        case _:
            yield from (scope.element for scope in formula.scopes)
            if isinstance(formula, ActAtFirst | ActAtSome):
                yield from (formula.arrival, formula.departure)
            yield formula.element


def alphabet(
    wanted: Iterable[EventPattern], rooms: Sequence[str] | None = None, moves: Sequence[str] | None = None
) -> list[Event]:
    """Return example events: one for each set of the `wanted` patterns that an event can match together.

    Args:
        wanted: the patterns.
        rooms: the rooms, for each of which events are generated; by default rooms with any names.
        moves: the requests to move, for each of which events are generated; by default any texts.
    """
    kinds: dict[str, list[EventPattern]] = {}
    for element in dict.fromkeys(wanted):
        kinds.setdefault(element.kind, []).append(element)
    places = _places([element for alike in kinds.values() for element in alike], rooms)
    held = _held([element.holding for alike in kinds.values() for element in alike])
    events: list[Event] = []
    for kind, alike in kinds.items():
        is_listed = kind == GOTO and moves is not None
        texts = (moves or ()) if is_listed else distinct_strings(_distinct(e.text for e in alike))
        answers = _texts([e.answer for e in alike])
        results = (None,) if all(e.found is None for e in alike) else (True, False)
        here = places if kind != GOTO or any(e.place for e in alike) else [""]
        things = held if any(e.holding for e in alike) else [""]
        people = _texts([e.to for e in alike])[any(e.to for e in alike) :]  # every question has an addressee
        said = product(texts, _more(alike), _options(alike))
        aspects = [
            [Event(kind, text, options, more=more) for text, more, options in said],
            [Event(kind, "", answer=answer, found=found) for answer, found in product(answers, results)],
            [Event(kind, "", place=place) for place in here],
            [Event(kind, "", holding=holding, to=to) for holding, to in product(things, people)],
        ]
        events += _distinct_events(alike, aspects, by_room=rooms is not None, by_text=is_listed)
    return events


def aspects_of(element: EventPattern) -> tuple[EventPattern, ...]:
    """Split a pattern into four, one each for texts, answer or result, room, and held object or addressee."""
    kind = element.kind
    return (
        EventPattern(kind, element.text, element.options, element.mention, more=element.more),
        EventPattern(kind, _MATCH_ANY, answer=element.answer, found=element.found),
        EventPattern(kind, _MATCH_ANY, place=element.place),
        EventPattern(kind, _MATCH_ANY, holding=element.holding, to=element.to),
    )


def _distinct_events(
    alike: Sequence[EventPattern], aspects: Sequence[Sequence[Event]], *, by_room: bool, by_text: bool
) -> Iterable[Event]:
    """Combine aspects into events, and keep the first event for each set of matching patterns.

    Bit masks of the patterns identify the sets, since there may be hundreds of thousands of combinations.
    """
    patterns = zip(*map(aspects_of, alike), strict=True)
    matched = [
        [(event, sum(is_match(one, event, 0) << bit for bit, one in enumerate(ones))) for event in given]
        for ones, given in zip(patterns, aspects, strict=True)
    ]
    distinct: dict[tuple[int, str, str], Event] = {}
    for (said, of_said), (heard, of_heard), (there, of_there), (held, of_held) in product(*matched):
        place, text = (by_room and there.place) or "", (by_text and said.text) or ""
        key = (of_said & of_heard & of_there & of_held, place, text)
        if key not in distinct:
            distinct[key] = Event(
                said.kind, said.text, said.options, heard.answer, heard.found, there.place,
                holding=held.holding, to=held.to, more=said.more,
            )  # fmt: skip
    return distinct.values()


def _distinct(texts: Iterable[TextPattern | None]) -> tuple[TextPattern, ...]:
    return tuple(dict.fromkeys(text for text in texts if text is not None))


def _places(wanted: Sequence[EventPattern], rooms: Sequence[str] | None) -> Sequence[str]:
    """Return rooms for all combinations of places, or an empty name if no pattern has a place."""
    regexes = _distinct(Regex(e.place_regex.pattern) for e in wanted if e.place_regex is not None)
    if not regexes:
        return [""]
    return distinct_strings(regexes) if rooms is None else rooms


def _more(alike: Sequence[EventPattern]) -> Iterable[tuple[str, ...]]:
    most = max(len(element.more) for element in alike)
    wanted = ([e.more[at] for e in alike if len(e.more) > at] for at in range(most))
    return product(*(distinct_strings(_distinct(texts), outer=True) for texts in wanted))


def _texts(wanted: Sequence[TextPattern | None]) -> list[str | None]:
    texts = _distinct(wanted)
    return [None, *(distinct_strings(texts, outer=True) if texts else ())]


def _held(wanted: Sequence[TextPattern | None]) -> list[str]:
    """Return things for all combinations of patterns, with an empty text for a robot that holds nothing."""
    texts = _distinct(wanted)
    x_is_like_empty = all(text.matches("x") == text.matches("") for text in texts)
    strings = (string or "x" for string in _texts(texts)[1:] if string or x_is_like_empty)
    return [*dict.fromkeys(["", *strings])]


def _options(wanted: Sequence[EventPattern]) -> Iterable[tuple[Option, ...]]:
    """Return options for all combinations of patterns."""
    texts = _distinct([*(e.options for e in wanted), *(e.text for e in wanted if e.mention)])
    found: dict[frozenset[TextPattern], tuple[Option, ...]] = {frozenset(): ()}
    for string in distinct_strings(texts, outer=True):
        matched = frozenset(text for text in texts if text.matches(string))
        for already, options in tuple(found.items()):
            longer = (*options, Option(string))
            if len(found.setdefault(already | matched, longer)) > len(longer):
                found[already | matched] = longer
    return found.values()
