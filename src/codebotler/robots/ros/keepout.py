"""Convert the rooms that house rules forbid into messages for Nav2's keepout filter."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from codebotler.core.skills.kinds import INSIDE
from codebotler.core.world import Room, crossings
from codebotler.rtl import And, EventPattern, Exists, Formula, Not
from codebotler.simulator.guard.house_rule import Rule

MASK_RESOLUTION = 0.05  # the side of a mask cell in metres
EMPTY_MASK = ((0.0, 0.0), (MASK_RESOLUTION, MASK_RESOLUTION))  # one free cell, to replace an earlier mask


def keepout_messages(
    rules: Sequence[Rule], rooms: Sequence[Room], frame: str = "map", topic: str = "/keepout_filter_mask"
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return Nav2's keepout mask (an OccupancyGrid) and the CostmapFilterInfo that describes it, as dicts.

    The mask covers each room that a rule `always: not tr.Exists(inside(...))` forbids. Other rules are
    ignored. `frame` is the coordinate frame of the rooms, and `topic` is where the mask will be published.
    """
    patterns = [element for rule in rules if rule.when == "always" for element in _forbidden(rule.formula)]
    zones = [r.footprint for r in rooms if r.footprint and any(e.text.matches(r.name) for e in patterns)]
    xs, ys = zip(*(corner for zone in zones or [EMPTY_MASK] for corner in zone), strict=True)
    left, bottom = (math.floor(min(each) / MASK_RESOLUTION) * MASK_RESOLUTION for each in (xs, ys))
    width = math.ceil((max(xs) - left) / MASK_RESOLUTION)
    height = math.ceil((max(ys) - bottom) / MASK_RESOLUTION)
    cells = [0] * (width * height)
    for row in range(height):
        for zone in zones:
            edges = crossings(bottom + (row + 0.5) * MASK_RESOLUTION, zone)
            columns = [round((edge - left) / MASK_RESOLUTION) for edge in edges]
            for first, end in zip(columns[::2], columns[1::2], strict=True):
                cells[row * width + first : row * width + end] = [100] * (end - first)
    origin = {"position": {"x": left, "y": bottom, "z": 0.0}, "orientation": {"w": 1.0}}
    info = {"resolution": MASK_RESOLUTION, "width": width, "height": height, "origin": origin}
    header = {"frame_id": frame}
    about = {"header": header, "type": 0, "filter_mask_topic": topic, "base": 0.0, "multiplier": 1.0}
    return {"header": header, "info": info, "data": cells}, about


def _forbidden(formula: Formula) -> Iterator[EventPattern]:
    """Yield the `inside` patterns that a formula forbids at all times and regardless of the held object."""
    match formula:
        case And(parts):
            for part in parts:
                yield from _forbidden(part)
        case Not(Exists(element, ())) if element == EventPattern(INSIDE, element.text):
            yield element
