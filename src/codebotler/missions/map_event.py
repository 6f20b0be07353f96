"""The event `map`: the rooms of a mission's world with their places in metres, and back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from codebotler.core.world import Point, Room, World, laid_out


def map_data(world: World) -> dict[str, Any]:
    """The rooms of a world, each with its corners and the point where the robot stops, in metres."""
    rooms = [
        {"name": room.name, "footprint": room.footprint, "stand_at": room.stand_at}
        for room in laid_out(world).rooms
    ]
    return {"rooms": rooms, "robot": world.robot}


def map_from(data: Mapping[str, Any]) -> World:
    """The world of an event `map`: only its rooms, and the room in which the robot starts."""
    rooms = [
        Room(room["name"], footprint=_points(room["footprint"]), stand_at=_point(room["stand_at"]))
        for room in data["rooms"]
    ]
    return World(tuple(rooms), data["robot"])


def _points(pairs: Iterable[Iterable[float]]) -> tuple[Point, ...]:
    return tuple(map(_point, pairs))


def _point(pair: Iterable[float]) -> Point:
    x, y = pair
    return x, y
