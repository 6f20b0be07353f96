"""A map of the rooms and the robot (SVG)."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from codebotler.core.terminal import shortened
from codebotler.core.world import Point, World, laid_out

MARGIN = 0.6
MOST_ROOMS = 100
WIDE = 0.62
"""The width of a letter, in heights of a letter."""

SMALLEST, LARGEST = 0.2, 0.62
MOST_LETTERS = 60


def floorplan(world: World, at: Point | None = None, room: str = "") -> str:
    """Draw a world as seen from above, with the robot's position if known, and its room or destination."""
    rooms = laid_out(world).rooms[:MOST_ROOMS]
    corners = [corner for one in rooms for corner in one.footprint or ()] + ([at] if at else [])
    left, right = min(x for x, _ in corners) - MARGIN, max(x for x, _ in corners) + MARGIN
    low, high = min(y for _, y in corners) - MARGIN, max(y for _, y in corners) + MARGIN
    parts = []
    for one in rooms:
        assert one.footprint is not None, "rooms are laid out"
        here = " here" if one.name == room else ""
        points = " ".join(f"{x - left:.2f},{high - y:.2f}" for x, y in one.footprint)
        parts.append(f'<polygon class="room{here}" points="{points}"/>')
        parts += _name(one.name, one.footprint, left, high)
    if at is not None:
        x, y = at[0] - left, high - at[1]
        parts.append(f'<g class="robot"><circle class="halo" cx="{x:.2f}" cy="{y:.2f}" r=".62"/>')
        parts.append(f'<circle class="body" cx="{x:.2f}" cy="{y:.2f}" r=".34"/></g>')
    where = f"The robot is in {room}." if room else "The robot's position is unknown."
    return (
        f'<svg class="floorplan" viewBox="0 0 {right - left:.2f} {high - low:.2f}" role="img" '
        f'aria-label="{escape(shortened(f"Map of {len(rooms)} rooms. {where}", 200))}">{"".join(parts)}</svg>'
    )


def _name(name: str, footprint: tuple[Point, ...], left: float, high: float) -> Iterator[str]:
    """The name of a room, at its upper side, in up to two lines: the robot mostly stands in the middle."""
    xs, ys = [x for x, _ in footprint], [y for _, y in footprint]
    lines = _broken(shortened(name, MOST_LETTERS))
    size = (max(xs) - min(xs)) * 0.92 / (WIDE * max(map(len, lines)) or 1)
    size = max(SMALLEST, min(LARGEST, size))
    x, y = (min(xs) + max(xs)) / 2 - left, high - max(ys)
    for number, line in enumerate(lines):
        down = y + size * (1.15 * number + 1.2)
        yield f'<text x="{x:.2f}" y="{down:.2f}" font-size="{size:.2f}">{escape(line)}</text>'


def _broken(name: str) -> list[str]:
    """A name in one line, or in two of about the same length."""
    words = name.split()
    if len(words) < 2 or len(name) < 9:  # noqa: PLR2004 - two words, and longer than fits
        return [name]
    at = min(range(1, len(words)), key=lambda n: max(len(" ".join(words[:n])), len(" ".join(words[n:]))))
    return [" ".join(words[:at]), " ".join(words[at:])]
