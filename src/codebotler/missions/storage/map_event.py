"""Convert the map of a mission's world to and from a `map` event."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from codebotler.core.world import Point, Room, World, laid_out


def map_data(world: World) -> dict[str, Any]:
    """Return the data of a `map` event for a log: rooms with corners and stopping points, in metres."""
    rooms = [
        {
            "name": room.name,
            "footprint": room.footprint,
            "stand_at": room.stand_at,
            **({"within": room.within} if room.within else {}),
        }
        for room in laid_out(world).rooms
    ]
    return {"rooms": rooms, "robot": world.robot}


def map_from(data: Mapping[str, Any]) -> World:
    """Return the world in a log's `map` event: only its rooms and the robot's starting room."""
    rooms = [
        Room(
            room["name"],
            footprint=tuple(map(_point, room["footprint"])),
            stand_at=_point(room["stand_at"]),
            within=room.get("within", ""),
        )
        for room in data["rooms"]
    ]
    return World(tuple(rooms), data["robot"])


def _point(pair: Iterable[float]) -> Point:
    x, y = pair
    return x, y
