"""Representative events: one for each way in which the elements of formulas can be met by an event."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeAlias

from codebotler.rtl import ActAtFirst, ActAtSome, And, Element, Formula, Not, Or, Regex, Text
from codebotler.trace import Event, Option
from roboeval.linting.sample_strings import representative_texts

Matches: TypeAlias = Callable[[Text, str], bool]
"""Whether a text of a formula is found in one that was said, asked or answered."""


def elements(formula: Formula) -> Iterator[Element]:
    """Everything that a formula looks for, in the order of its text; for a stay, the moves that bound it."""
    match formula:
        case And(parts) | Or(parts):
            for part in parts:
                yield from elements(part)
        case Not(part):
            yield from elements(part)
        case _:
            yield from (cut.element for cut in formula.cuts)
            if isinstance(formula, ActAtFirst | ActAtSome):
                yield from (formula.stay.arrival, formula.stay.departure)
            yield formula.element


def representative_events(wanted: Iterable[Element], rooms: Sequence[str] | None = None) -> list[Event]:
    """Events that match the elements in all combinations for which texts were found.

    Args:
        wanted: what the events are to be told apart by.
        rooms: where they may happen; by default anywhere. Where no element says where, none of them does.
    """
    kinds: dict[str, list[Element]] = {}
    for element in dict.fromkeys(wanted):
        kinds.setdefault(element.kind, []).append(element)
    places = _places([element for alike in kinds.values() for element in alike], rooms)
    events = []
    for kind, alike in kinds.items():
        texts = representative_texts(tuple(dict.fromkeys(element.text for element in alike)))
        options = [element.options for element in alike if element.options is not None]
        options += [element.text for element in alike if element.mention]
        choices = _choices(tuple(dict.fromkeys(options)))
        here = places if kind != "goto" else [""]
        answers: list[str | None] = [None]
        answered = dict.fromkeys(element.answer for element in alike if element.answer is not None)
        answers += representative_texts(tuple(answered), outer=True) if answered else ()
        events += [
            Event(kind, text, choice, answer, place=place)
            for text in texts
            for choice in choices
            for answer in answers
            for place in here
        ]
    return events


def _places(wanted: Sequence[Element], rooms: Sequence[str] | None) -> Sequence[str]:
    """Rooms in which what is wanted may happen or not, in all combinations."""
    regexes = tuple(dict.fromkeys(e.is_place.pattern for e in wanted if e.is_place is not None))
    if not regexes:
        return [""]
    return rooms if rooms is not None else representative_texts(tuple(map(Regex, regexes)))


def _choices(wanted: tuple[Text, ...]) -> Iterable[tuple[Option, ...]]:
    """Options of which some match, in all combinations; one may match what another cannot match as well."""
    found: dict[frozenset[Text], tuple[Option, ...]] = {frozenset(): ()}
    for text in representative_texts(wanted, outer=True):
        matched = frozenset(one for one in wanted if one.matches(text))
        for already, choice in tuple(found.items()):
            found.setdefault(already | matched, (*choice, Option(text)))
    return found.values()


def fits(element: Element, event: Event, matches: Matches) -> bool:
    """Whether an event is of a kind; its options are texts.

    Args:
        element: what kind.
        event: the event.
        matches: whether a text of the element is found in one of the event; it is asked of many events alike.
    """
    if element.kind != event.kind or not element.happens_at(event.place):
        return False
    if element.answer is not None and (event.answer is None or not matches(element.answer, event.answer)):
        return False
    if element.mention and any(matches(element.text, option.text) for option in event.options):
        return True
    offered = element.options is None or any(matches(element.options, o.text) for o in event.options)
    return offered and matches(element.text, event.text)
