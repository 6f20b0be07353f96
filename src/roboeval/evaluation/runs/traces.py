"""Stores the circumstances of events, such as the room, separately from the trace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from codebotler.core.skills.kinds import GOTO
from codebotler.core.trace import Event, Trace, trace_from

CIRCUMSTANCES = ("places", "holding", "to", "destinations")


def circumstances(trace: Trace) -> dict[str, list[list[Any]]]:
    """Return at which events (from 1) the robot's room, the thing it holds or the person it asks changes.

    `places` is always present. The other entries are present only if they are not empty:

    - `places`: `[number, room]`, the room from that event on; the last number may be one more than the
      number of events.
    - `holding`: `[number, thing]`, what the robot holds from that event on, or an empty string for nothing;
      at the start, it holds nothing.
    - `to`: `[number, person]`, whom events of the same kind ask from that event on, or null for nobody.
    - `destinations`: `[number, room]`, the goal of a drive if it differs from the place of the next event, or
      null if the drive failed.
    """
    places = [event.place for event in trace]
    places += [event.destination or event.place for event in trace[-1:]]  # the last room the robot was in
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
    changes = enumerate(zip([first, *values], values, strict=False), 1)
    return [[number, new] for number, (old, new) in changes if new != old]


def _changes_by_kind(trace: Trace) -> list[list[Any]]:
    kinds = {event.kind for event in trace if event.to is not None}
    last: dict[str, str | None] = {}
    changes: list[list[Any]] = []
    for number, event in enumerate(trace, 1):
        if event.kind in kinds and event.to != last.get(event.kind):
            last[event.kind] = event.to
            changes.append([number, event.to])
    return changes


def first_events(verdict: Mapping[str, Any], count: int) -> dict[str, Any]:
    """Cut a verdict (as JSON data) to its first `count` events. Keep the place after the last one."""
    known = {name: verdict[name] for name in CIRCUMSTANCES if name in verdict}
    kept = {
        name: [entry for entry in entries if entry[0] <= count + (name == "places")]
        for name, entries in known.items()
    }
    return {**verdict, "trace": verdict["trace"][:count], **kept}


def trace_of(verdict: Mapping[str, Any]) -> Trace:
    """Restore the trace of a verdict from a row, with everything that formulas refer to."""
    places, holding, to, destinations = (dict(verdict.get(name, ())) for name in CIRCUMSTANCES)
    here, held, events = "", "", []
    asked: dict[str, str | None] = {}  # the person asked last, by kind of event
    for number, event in enumerate(trace_from(verdict["trace"]), 1):
        here, held = places.get(number, here), holding.get(number, held)
        if number in to:
            asked[event.kind] = to[number]
        seen = event.kind, event.text, event.options, event.answer, event.found
        led = destinations.get(number, places.get(number + 1, here)) if event.kind == GOTO else None
        events.append(Event(*seen, here, 0.0, held, asked.get(event.kind), event.more, led))
    return tuple(events)
