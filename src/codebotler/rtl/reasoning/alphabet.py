"""Reduces all possible events to a finite set: one for each way in which formulas can tell them apart."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from codebotler.core.trace import Event, Option
from codebotler.rtl.formulas import ActAtFirst, ActAtSome, And, EventPattern, Formula, Not, Or, Regex, Text
from codebotler.rtl.reasoning.sample_strings import distinct_strings


def elements(formula: Formula) -> Iterator[EventPattern]:
    """All elements of a formula in the order of its text, and the moves that bound its stays."""
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


def alphabet(wanted: Iterable[EventPattern], rooms: Sequence[str] | None = None) -> list[Event]:
    """Events in given rooms, or any, that match elements in all combinations for which strings were found."""
    kinds: dict[str, list[EventPattern]] = {}
    for element in dict.fromkeys(wanted):
        kinds.setdefault(element.kind, []).append(element)
    places = _places([element for alike in kinds.values() for element in alike], rooms)
    return [
        Event(kind, text, options, answer, place=place)
        for kind, alike in kinds.items()
        for text in distinct_strings(_distinct(element.text for element in alike))
        for options in _options(alike)
        for answer in _answers(alike)
        for place in (places if kind != "goto" else [""])
    ]


def _distinct(texts: Iterable[Text | None]) -> tuple[Text, ...]:
    return tuple(dict.fromkeys(text for text in texts if text is not None))


def _places(wanted: Sequence[EventPattern], rooms: Sequence[str] | None) -> Sequence[str]:
    """Rooms that match the elements' places in all combinations; an empty name if no element has a place."""
    regexes = _distinct(Regex(e.place_regex.pattern) for e in wanted if e.place_regex is not None)
    if not regexes:
        return [""]
    return distinct_strings(regexes) if rooms is None else rooms


def _answers(wanted: Sequence[EventPattern]) -> list[str | None]:
    answers = _distinct(element.answer for element in wanted)
    return [None, *(distinct_strings(answers, outer=True) if answers else ())]


def _options(wanted: Sequence[EventPattern]) -> Iterable[tuple[Option, ...]]:
    """Options that match in all combinations; one option may match what another cannot match as well."""
    texts = _distinct([*(e.options for e in wanted), *(e.text for e in wanted if e.mention)])
    found: dict[frozenset[Text], tuple[Option, ...]] = {frozenset(): ()}
    for string in distinct_strings(texts, outer=True):
        matched = frozenset(text for text in texts if text.matches(string))
        for already, options in tuple(found.items()):
            found.setdefault(already | matched, (*options, Option(string)))
    return found.values()
