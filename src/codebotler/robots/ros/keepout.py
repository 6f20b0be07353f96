"""The zones of house rules that no path may enter, as messages for the keepout filter of Nav2."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from codebotler.core.skills.declaration import INSIDE
from codebotler.core.world import Room, crossings
from codebotler.rtl import And, EventPattern, Exists, Formula, Not
from codebotler.simulator.house_rule import Rule

RESOLUTION = 0.05  # metres
NOWHERE = ((0.0, 0.0), (RESOLUTION, RESOLUTION))  # what an empty mask covers, which replaces an earlier one


def keepout(
    rules: Sequence[Rule], rooms: Sequence[Room], frame: str = "map", topic: str = "/keepout_filter_mask"
) -> tuple[dict[str, Any], dict[str, Any]]:
    """A nav_msgs/OccupancyGrid and a nav2_msgs/CostmapFilterInfo.

    Args:
        rules: the rules in force; those of the form `always: not tr.Exists(inside(...))` count.
        rooms: the rooms with their footprints.
        frame: of the footprints.
        topic: on which the grid will be published, latched.
    """
    never = [element for rule in rules if rule.when == "always" for element in _never(rule.formula)]
    zones = [r.footprint for r in rooms if r.footprint and any(e.text.matches(r.name) for e in never)]
    xs, ys = zip(*(corner for zone in zones or [NOWHERE] for corner in zone), strict=True)
    left, bottom = (math.floor(min(each) / RESOLUTION) * RESOLUTION for each in (xs, ys))
    width, height = (math.ceil((max(each) - low) / RESOLUTION) for each, low in ((xs, left), (ys, bottom)))
    cells = [0] * (width * height)
    for row in range(height):
        for zone in zones:
            edges = crossings(bottom + (row + 0.5) * RESOLUTION, zone)
            columns = [round((edge - left) / RESOLUTION) for edge in edges]
            for first, end in zip(columns[::2], columns[1::2], strict=True):
                cells[row * width + first : row * width + end] = [100] * (end - first)
    origin = {"position": {"x": left, "y": bottom, "z": 0.0}, "orientation": {"w": 1.0}}
    info = {"resolution": RESOLUTION, "width": width, "height": height, "origin": origin}
    header = {"frame_id": frame}
    about = {"header": header, "type": 0, "filter_mask_topic": topic, "base": 0.0, "multiplier": 1.0}
    return {"header": header, "info": info, "data": cells}, about


def _never(formula: Formula) -> Iterator[EventPattern]:
    """The elements of `inside` that a formula forbids at any time, whatever the robot holds."""
    match formula:
        case And(parts):
            for part in parts:
                yield from _never(part)
        case Not(Exists(element, ())) if element == EventPattern(INSIDE, element.text):
            yield element
