"""Draws the rooms of both packages, as import-linter keeps them, into docs/pictures/rooms.svg."""

from __future__ import annotations

import textwrap
import tomllib
from collections.abc import Sequence
from html import escape

from modules import ROOT, first_line

PICTURE = ROOT / "docs" / "pictures" / "rooms.svg"
WIDE, GAP, HEAD, LINE = 880, 8, 34, 15  # Pixels of the picture, gaps, package heads and lines.
STYLE = """
text { font: 12px system-ui, sans-serif; fill: #46525f }
.room { font-weight: 600; font-size: 14px; fill: #14202c }
.package { font-weight: 600; font-size: 17px; fill: #14202c }
rect { fill: #eef3f8; stroke: #b9c6d3 }
@media (prefers-color-scheme: dark) {
  text { fill: #b4c0cc }
  .room, .package { fill: #eef3f8 }
  rect { fill: #22303d; stroke: #4a5d6f }
}
"""


def picture() -> str:
    """Return a picture of both packages, where each layer imports only from layers below it."""
    parts, top = [], 0
    for package in ("roboeval", "codebotler"):
        parts.append(f'<text class="package" x="0" y="{top + 20}">{package}</text>')
        layers = [layer.split(" | ") for layer in _layers(package) if layer != "__main__"]
        top += HEAD
        for rooms in layers:
            drawn, high = _layer(package, rooms, top)
            parts += drawn
            top += high + GAP
        top += GAP
    size = f'viewBox="-1 0 {WIDE + 2} {top}"'
    title = "<title>The rooms of both packages; each imports only those below it</title>"
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" {size}>',
            title,
            f"<style>{STYLE}</style>",
            *parts,
            "</svg>\n",
        ]
    )


def _layers(package: str) -> list[str]:
    """Return the layers of a package in pyproject.toml, from the top."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers: list[str] = next(one["layers"] for one in contracts if one.get("containers") == [package])
    return layers


def _layer(package: str, rooms: Sequence[str], top: int) -> tuple[list[str], int]:
    """Return a layer and its height; the text of a single room is beside its name, not below."""
    is_alone = len(rooms) == 1
    wide = (WIDE - GAP * (len(rooms) - 1)) // len(rooms)
    right, down = (112, 0) if is_alone else (12, 17)
    texts = [textwrap.wrap(_description(package, room), (wide - right) // 6 - 6) for room in rooms]
    high = LINE * max(map(len, texts)) + down + 17
    drawn = []
    for number, (room, lines) in enumerate(zip(rooms, texts, strict=True)):
        left = number * (wide + GAP)
        drawn.append(f'<rect x="{left}" y="{top}" width="{wide}" height="{high}" rx="7"/>')
        drawn.append(f'<text class="room" x="{left + 12}" y="{top + 21}">{room}/</text>')
        for at, line in enumerate(lines):
            y = top + 21 + down + LINE * at
            drawn.append(f'<text x="{left + right}" y="{y}">{escape(line, quote=False)}</text>')
    return drawn, high


def _description(package: str, room: str) -> str:
    return first_line(ROOT / "src" / package / room / "__init__.py").replace("`", "").rstrip(".")


if __name__ == "__main__":
    PICTURE.write_text(picture())
