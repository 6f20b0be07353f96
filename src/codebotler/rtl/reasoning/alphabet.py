"""Reduces all possible events to a finite set: one for each way in which formulas can tell them apart."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import Any, overload

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


def alphabet(
    wanted: Iterable[EventPattern],
    rooms: Sequence[str] | None = None,
    moves: Sequence[str] | None = None,
) -> list[Event]:
    """Events that match elements in all combinations for which strings were found.

    Args:
        wanted: the elements.
        rooms: where events happen; by default in rooms of any names.
        moves: the requests to move; by default any texts.
    """
    kinds: dict[str, list[EventPattern]] = {}
    for element in dict.fromkeys(wanted):
        kinds.setdefault(element.kind, []).append(element)
    places = _places([element for alike in kinds.values() for element in alike], rooms)
    held = _texts([element.holding for alike in kinds.values() for element in alike], nothing="")
    return [
        Event(kind, text, options, answer, found, place, holding=holding, to=to, more=more)
        for kind, alike in kinds.items()
        for text in (moves if kind == "goto" and moves is not None else _requests(alike))
        for more in _more(alike)
        for options in _options(alike)
        for answer in _texts([element.answer for element in alike])
        for found in ([None] if all(e.found is None for e in alike) else [True, False])
        for place in (places if kind != "goto" or any(e.place for e in alike) else [""])
        for holding in (held if any(e.holding for e in alike) else [""])
        for to in _texts([element.to for element in alike])[any(e.to for e in alike) :]  # each has somebody
    ]


def _distinct(texts: Iterable[Text | None]) -> tuple[Text, ...]:
    return tuple(dict.fromkeys(text for text in texts if text is not None))


def _places(wanted: Sequence[EventPattern], rooms: Sequence[str] | None) -> Sequence[str]:
    """Rooms that match the elements' places in all combinations; an empty name if no element has a place."""
    regexes = _distinct(Regex(e.place_regex.pattern) for e in wanted if e.place_regex is not None)
    if not regexes:
        return [""]
    return distinct_strings(regexes) if rooms is None else rooms


def _requests(alike: Sequence[EventPattern]) -> Sequence[str]:
    return distinct_strings(_distinct(element.text for element in alike))


def _more(alike: Sequence[EventPattern]) -> Iterable[tuple[str, ...]]:
    """Further arguments that match in all combinations; none where no element has any."""
    most = max(len(element.more) for element in alike)
    wanted = ([e.more[at] for e in alike if len(e.more) > at] for at in range(most))
    return product(*(distinct_strings(_distinct(texts), outer=True) for texts in wanted))


@overload
def _texts(wanted: Sequence[Text | None]) -> list[str | None]: ...
@overload
def _texts(wanted: Sequence[Text | None], nothing: str) -> list[str]: ...
def _texts(wanted: Sequence[Text | None], nothing: str | None = None) -> list[Any]:
    """Texts that match in all combinations, and what stands for there being none."""
    texts = _distinct(wanted)
    strings = distinct_strings(texts, outer=True) if texts else ()
    if nothing == "":  # which stands for there being none, so that an empty text needs another spelling
        strings = tuple(string or "x" for string in strings if string or _is_as_empty("x", texts))
    return [*dict.fromkeys([nothing, *strings])]


def _is_as_empty(string: str, texts: Sequence[Text]) -> bool:
    return all(text.matches(string) == text.matches("") for text in texts)


def _options(wanted: Sequence[EventPattern]) -> Iterable[tuple[Option, ...]]:
    """Options that match in all combinations; one option may match what another cannot match as well."""
    texts = _distinct([*(e.options for e in wanted), *(e.text for e in wanted if e.mention)])
    found: dict[frozenset[Text], tuple[Option, ...]] = {frozenset(): ()}
    for string in distinct_strings(texts, outer=True):
        matched = frozenset(text for text in texts if text.matches(string))
        for already, options in tuple(found.items()):
            found.setdefault(already | matched, (*options, Option(string)))
    return found.values()
