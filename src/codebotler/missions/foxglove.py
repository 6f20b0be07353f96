"""Messages by whose schemas Foxglove recognises poses, frames, rooms, log lines and pictures."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

from codebotler.core.world import Point, Room

Schema: TypeAlias = Mapping[str, Any]
Message: TypeAlias = dict[str, Any]

MAP, ROBOT = "map", "robot"
"""The frames: rooms and poses are in `map`, which the 3D panel displays by default."""

SECOND = 1_000_000_000  # nanoseconds
DEBUG, INFO, WARNING, ERROR = 1, 2, 3, 4  # levels of a log line
LINE_LOOP = 1  # the type of a closed line
LINE_WIDTH, LETTER_HEIGHT = 0.05, 0.4  # metres
COLOR = {"r": 0.35, "g": 0.55, "b": 0.8, "a": 1.0}
FORMATS = {"jpg": "jpeg", "png": "png"}

TEXT: Schema = {"type": "string"}
NUMBER: Schema = {"type": "number"}
WHOLE: Schema = {"type": "integer"}
YES_OR_NO: Schema = {"type": "boolean"}


def _object(title: str = "", **properties: Schema) -> Schema:
    return {"type": "object", **({"title": title} if title else {}), "properties": properties}


def _array(items: Schema) -> Schema:
    return {"type": "array", "items": items}


TIME = _object("time", sec=WHOLE, nsec=WHOLE)
DURATION = _object("duration", sec=WHOLE, nsec=WHOLE)
VECTOR = _object(x=NUMBER, y=NUMBER, z=NUMBER)
QUATERNION = _object(x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
POSE = _object(position=VECTOR, orientation=QUATERNION)
RGBA = _object(r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)
LINE = _object(
    type=WHOLE, pose=POSE, thickness=NUMBER, scale_invariant=YES_OR_NO, points=_array(VECTOR), color=RGBA
)
LABEL = _object(
    pose=POSE, billboard=YES_OR_NO, font_size=NUMBER, scale_invariant=YES_OR_NO, color=RGBA, text=TEXT
)
ENTITY = _object(
    timestamp=TIME,
    frame_id=TEXT,
    id=TEXT,
    lifetime=DURATION,
    frame_locked=YES_OR_NO,
    lines=_array(LINE),
    texts=_array(LABEL),
)

SCHEMAS: Mapping[str, Schema] = {
    "foxglove.PoseInFrame": _object(timestamp=TIME, frame_id=TEXT, pose=POSE),
    "foxglove.FrameTransform": _object(
        timestamp=TIME,
        parent_frame_id=TEXT,
        child_frame_id=TEXT,
        translation=VECTOR,
        rotation=QUATERNION,
    ),
    "foxglove.SceneUpdate": _object(entities=_array(ENTITY)),
    "foxglove.Log": _object(timestamp=TIME, level=WHOLE, message=TEXT, name=TEXT, file=TEXT, line=WHOLE),
    "foxglove.CompressedImage": _object(
        timestamp=TIME, frame_id=TEXT, data={**TEXT, "contentEncoding": "base64"}, format=TEXT
    ),
}
"""The schemas by name, with the fields that are written here."""


def pose_in_frame(at: Point, heading: float, time: int) -> Message:
    """Where the robot is.

    Args:
        at: its position in metres.
        heading: the direction in which it moves, in radians from the x axis.
        time: nanoseconds since 1970.
    """
    return {"timestamp": _time(time), "frame_id": MAP, "pose": _pose(at, heading)}


def frame_transform(at: Point, heading: float, time: int) -> Message:
    """The robot's frame in the frame of the map; the arguments are those of `pose_in_frame`."""
    pose = _pose(at, heading)
    return {
        "timestamp": _time(time),
        "parent_frame_id": MAP,
        "child_frame_id": ROBOT,
        "translation": pose["position"],
        "rotation": pose["orientation"],
    }


def scene_update(rooms: Iterable[Room], time: int) -> Message:
    """The outlines and names of rooms that have a footprint and a point where the robot stops."""
    return {"entities": [_entity(room, time) for room in rooms]}


def log_line(level: int, message: str, name: str, line: int | None, time: int) -> Message:
    """A line of the log.

    Args:
        level: DEBUG, INFO, WARNING or ERROR.
        message: what happened.
        name: the skill, or the kind of event.
        line: the line of the program, if known.
        time: nanoseconds since 1970.
    """
    where = {"file": "", "line": 0} if line is None else {"file": "program.py", "line": line}
    return {"timestamp": _time(time), "level": level, "message": message, "name": name, **where}


def compressed_image(kind: str, data: bytes, time: int) -> Message:
    """A picture: its kind is `jpg` or `png`, its time is in nanoseconds since 1970."""
    encoded = base64.b64encode(data).decode()
    return {"timestamp": _time(time), "frame_id": "", "data": encoded, "format": FORMATS[kind]}


def _time(time: int) -> Message:
    return {"sec": time // SECOND, "nsec": time % SECOND}


def _vector(at: Point) -> Message:
    return {"x": at[0], "y": at[1], "z": 0.0}


def _pose(at: Point, heading: float = 0.0) -> Message:
    turn = {"x": 0.0, "y": 0.0, "z": round(math.sin(heading / 2), 6), "w": round(math.cos(heading / 2), 6)}
    return {"position": _vector(at), "orientation": turn}


def _entity(room: Room, time: int) -> Message:
    assert room.footprint is not None, "rooms are laid out"
    assert room.stand_at is not None, "rooms are laid out"
    outline = {
        "type": LINE_LOOP,
        "pose": _pose((0.0, 0.0)),
        "thickness": LINE_WIDTH,
        "scale_invariant": False,
        "points": [*map(_vector, room.footprint)],
        "color": COLOR,
    }
    label = {
        "pose": _pose(room.stand_at),
        "billboard": True,
        "font_size": LETTER_HEIGHT,
        "scale_invariant": False,
        "color": COLOR,
        "text": room.name,
    }
    return {
        "timestamp": _time(time),
        "frame_id": MAP,
        "id": room.name,
        "lifetime": {"sec": 0, "nsec": 0},  # until another one replaces it
        "frame_locked": True,
        "lines": [outline],
        "texts": [label],
    }
