"""Under which circumstances events happened: how rows keep that beside a trace, and how it is read back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from codebotler.core.skills.kinds import GOTO
from codebotler.core.trace import Event, Trace, trace_from

CIRCUMSTANCES = ("places", "holding", "to", "destinations")


def circumstances(trace: Trace) -> dict[str, list[list[Any]]]:
    """Where events happened and what else formulas compare, as far as it changes; numbers count from 1.

    `places` is always there, the others only where they hold something:

    - `places`: `[number, room]`, from which event on the robot is in which room; the number of the last entry
      may be one more than there are events.
    - `holding`: `[number, thing]`, from which event on it holds what; nothing at first, and where the thing
      is empty.
    - `to`: `[number, person]`, whom a question is for, and those of its kind from then on; null for nobody.
    - `destinations`: `[number, room]`, where a drive led, if not to the place of the next event; null if it
      failed.
    """
    places = [event.place for event in trace]
    places += [event.destination or event.place for event in trace[-1:]]  # where the robot is at the end
    drives = [number for number, event in enumerate(trace, 1) if event.kind == GOTO]
    led = [(number, trace[number - 1].destination) for number in drives]
    found = {
        "places": _changes(places, None),
        "holding": _changes([event.holding for event in trace], ""),
        "to": _changes_by_kind(trace),
        "destinations": [[number, room] for number, room in led if room != places[number]],
    }
    return {name: data for name, data in found.items() if data or name == "places"}


def _changes(values: Sequence[str], first: str | None) -> list[list[Any]]:
    """The values that are others than the one before, with their numbers."""
    changes = enumerate(zip([first, *values], values, strict=False), 1)
    return [[number, new] for number, (old, new) in changes if new != old]


def _changes_by_kind(trace: Trace) -> list[list[Any]]:
    """Whom questions are for, where it is somebody else than for the last event of the same kind."""
    kinds = {event.kind for event in trace if event.to is not None}
    last: dict[str, str | None] = {}
    changes: list[list[Any]] = []
    for number, event in enumerate(trace, 1):
        if event.kind in kinds and event.to != last.get(event.kind):
            last[event.kind] = event.to
            changes.append([number, event.to])
    return changes


def first_events(verdict: Mapping[str, Any], count: int) -> dict[str, Any]:
    """The data of a verdict with so many events; of the places, those after the last of them are kept."""
    known = {name: verdict[name] for name in CIRCUMSTANCES if name in verdict}
    kept = {
        name: [entry for entry in entries if entry[0] <= count + (name == "places")]
        for name, entries in known.items()
    }
    return {**verdict, "trace": verdict["trace"][:count], **kept}


def without_trace(verdict: Mapping[str, Any]) -> dict[str, Any]:
    """The data of a verdict with no events."""
    return {name: value for name, value in verdict.items() if name not in CIRCUMSTANCES} | {"trace": []}


def trace_of(verdict: Mapping[str, Any]) -> Trace:
    """Restore the trace of a verdict in a row, with all that formulas compare."""
    places, holding, to, destinations = (dict(verdict.get(name, ())) for name in CIRCUMSTANCES)
    here, held, events = "", "", []
    asked: dict[str, str | None] = {}  # by the kind of event
    for number, event in enumerate(trace_from(verdict["trace"]), 1):
        here, held = places.get(number, here), holding.get(number, held)
        if number in to:
            asked[event.kind] = to[number]
        seen = event.kind, event.text, event.options, event.answer, event.found
        led = None
        if event.kind == GOTO:
            led = destinations.get(number, places.get(number + 1, here))
        events.append(Event(*seen, here, 0.0, held, asked.get(event.kind), event.more, led))
    return tuple(events)
