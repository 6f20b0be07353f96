"""Build messages in Foxglove's schemas: poses, frames, rooms, log lines and pictures."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

from codebotler.core.world import Point, Room

Message: TypeAlias = dict[str, Any]

MAP_FRAME, ROBOT_FRAME = "map", "robot"
"""The coordinate frames. Foxglove's 3D panel displays `map` by default."""

SECOND_NS = 1_000_000_000  # nanoseconds
LEVEL_DEBUG, LEVEL_INFO, LEVEL_WARNING, LEVEL_ERROR = 1, 2, 3, 4
_LINE_LOOP = 1  # the line type for a closed outline
_LINE_WIDTH, _LETTER_HEIGHT = 0.05, 0.4  # metres
_OUTLINE_COLOR = {"r": 0.35, "g": 0.55, "b": 0.8, "a": 1.0}
_IMAGE_FORMATS = {"jpg": "jpeg", "png": "png"}


def pose_in_frame(at: Point, heading: float, time: int) -> Message:
    """Build a pose message: position in metres, heading in radians from the x axis, time in ns since 1970."""
    return {"timestamp": _time(time), "frame_id": MAP_FRAME, "pose": _pose(at, heading)}


def frame_transform(at: Point, heading: float, time: int) -> Message:
    """Build the transform from the map to the robot's frame, from the same values as `pose_in_frame`."""
    pose = _pose(at, heading)
    return {
        "timestamp": _time(time),
        "parent_frame_id": MAP_FRAME,
        "child_frame_id": ROBOT_FRAME,
        "translation": pose["position"],
        "rotation": pose["orientation"],
    }


def log_line(level: int, message: str, name: str, line: int | None, time: int) -> Message:
    """Build a log message about the skill or event `name`. `level`: 1 to 4 (error). `time`: ns since 1970."""
    where = {"file": "", "line": 0} if line is None else {"file": "program.py", "line": line}
    return {"timestamp": _time(time), "level": level, "message": message, "name": name, **where}


def compressed_image(kind: str, data: bytes, time: int) -> Message:
    """Build an image message. `kind` is `jpg` or `png`, and `time` is in ns since 1970."""
    return {"timestamp": _time(time), "frame_id": "", "data": data, "format": _IMAGE_FORMATS[kind]}


def _time(time: int) -> Message:
    return {"sec": time // SECOND_NS, "nsec": time % SECOND_NS}


def _vector(at: Point) -> Message:
    return {"x": at[0], "y": at[1], "z": 0.0}


def _pose(at: Point, heading: float = 0.0) -> Message:
    turn = {"x": 0.0, "y": 0.0, "z": round(math.sin(heading / 2), 6), "w": round(math.cos(heading / 2), 6)}
    return {"position": _vector(at), "orientation": turn}


def scene_entity(room: Room, time: int) -> Message:
    """Build a message that draws a room's outline and name. The room needs a footprint and `stand_at`."""
    assert room.footprint is not None, "rooms are laid out"
    assert room.stand_at is not None, "rooms are laid out"
    outline = {
        "type": _LINE_LOOP,
        "pose": _pose((0.0, 0.0)),
        "thickness": _LINE_WIDTH,
        "scale_invariant": False,
        "points": [*map(_vector, room.footprint)],
        "color": _OUTLINE_COLOR,
    }
    label = {
        "pose": _pose(room.stand_at),
        "billboard": True,
        "font_size": _LETTER_HEIGHT,
        "scale_invariant": False,
        "color": _OUTLINE_COLOR,
        "text": room.name,
    }
    return {
        "timestamp": _time(time),
        "frame_id": MAP_FRAME,
        "id": room.name,
        "frame_locked": True,
        "lines": [outline],
        "texts": [label],
    }
