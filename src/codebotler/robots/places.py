"""Stand-in until merged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Place:
    name: str
    x: float
    y: float
    yaw: float = 0.0
    polygon: tuple[tuple[float, float], ...] | None = None


@dataclass(frozen=True)
class Places:
    frame: str
    places: tuple[Place, ...]

    def room_at(self, x: float, y: float) -> Place | None: ...
    def nearest(self, x: float, y: float) -> Place: ...
    def named(self, text: str) -> Place | None: ...


def read_places(file: Any, key: str) -> Places: ...
