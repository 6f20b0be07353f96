"""Missions as MCAP files, for Foxglove and other tools of roboticists."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple, TypeAlias
from uuid import uuid4

from mcap.writer import Writer

from codebotler import __version__
from codebotler.core.files import expect_replaceable, open_replacement
from codebotler.core.world import Point, World
from codebotler.missions import foxglove
from codebotler.missions.foxglove import (
    DEBUG,
    ERROR,
    INFO,
    NUMBER,
    SECOND,
    TEXT,
    WARNING,
    WHOLE,
    Message,
    Schema,
)
from codebotler.missions.log import Line, State, Summary
from codebotler.missions.map_event import map_from
from codebotler.missions.pictures import picture_of
from codebotler.missions.progress import Progress, position
from codebotler.missions.wording import event_text
from codebotler.simulator.sampled_robot import RoomMap

Clock: TypeAlias = Literal["wall", "robot"]

LATEST = 2**63 - 1024  # nanoseconds since 1970 that every reader can hold
STATES, NOTES, POSE, FRAMES, ROOMS = "/mission/state", "/mission/log", "/robot/pose", "/tf", "/rooms"
DETAILS = ("text", "message", "file")
"""The keys of a skill's events that hold text."""
LEVELS = {"feedback": DEBUG, "error": ERROR, **dict.fromkeys(("rule", "stop", "cancelled", "late"), WARNING)}
"""The levels of log lines, by kind of event; for others it is INFO."""
STATE_SCHEMA: Schema = {
    "type": "object",
    "properties": {"state": TEXT, "reason": TEXT, "clock": NUMBER},
}
TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}


class Item(NamedTuple):
    """A message for a topic; a schema of Foxglove's goes by its name, others by their topic."""

    topic: str
    message: Message
    schema: Schema | str


def write_mcap(
    file: IO[bytes],
    summary: Summary,
    events: Sequence[Line],
    *,
    folder: Path | None = None,
    clock: Clock = "wall",
) -> None:
    """Write a mission: a topic for each skill, and topics for states, the log, the robot's pose and rooms.

    The program is attached. Messages are timed by the clock on the wall, or by the robot's, put to start with
    the mission. Pictures lie in its `folder`; None leaves them out.
    """
    began = round(min(summary.created * SECOND, LATEST))
    writer = Writer(file)
    writer.start(profile="", library=f"codebotler {__version__}")
    channels: dict[str, int] = {}
    skills, way = _Skills(events), _Way()

    def time(line: Line) -> int:
        seconds: float = line["time"] if clock == "wall" else summary.created + line["clock"]
        return round(min(seconds * SECOND, LATEST))

    def add(topic: str, message: Message, schema: Schema | str, at: int) -> None:
        if topic not in channels:
            name = "codebotler." + topic.strip("/").replace("/", ".")
            name, data = (schema, foxglove.SCHEMAS[schema]) if isinstance(schema, str) else (name, schema)
            number = writer.register_schema(name, "jsonschema", json.dumps(data).encode())
            channels[topic] = writer.register_channel(topic, "json", number)
        writer.add_message(channels[topic], at, json.dumps(message).encode(), at)

    for line in events:
        at = time(line)
        for item in (*_items(line, skills, at), *_pictures(line, folder, at), *way.items(line, at)):
            add(*item, at)
    last = time(events[-1]) if events else began
    program = summary.program.encode(errors="surrogatepass")
    writer.add_attachment(began, last, "program.py", "text/x-python", program)
    writer.add_metadata("mission", _about(summary))
    writer.finish()  # type: ignore[no-untyped-call]  # theirs


def _items(line: Line, skills: _Skills, at: int) -> Iterator[Item]:
    """The messages about an event: of its skill, of the state, and a line of the log."""
    event = line["event"]
    if "skill" in line:
        yield skills.item(line)
    if event == "state":
        message = {"state": line["state"], "reason": line.get("reason", ""), "clock": line["clock"]}
        yield Item(STATES, message, STATE_SCHEMA)
    text = event_text(line)
    if not text or (event == "sleep" and not line["seconds"]):
        return
    level = ERROR if line.get("state") == State.FAILED else LEVELS.get(event, INFO)
    name = str(line.get("skill", event))
    yield Item(NOTES, foxglove.log_line(level, text, name, line.get("line"), at), "foxglove.Log")


def _pictures(line: Line, folder: Path | None, at: int) -> Iterator[Item]:
    if folder is not None and (picture := picture_of(folder, line)) is not None:
        image = foxglove.compressed_image(*picture, at)
        yield Item(f"/skill/{line['skill']}/picture", image, "foxglove.CompressedImage")


class _Skills:
    """The messages of skills, with schemas of the arguments and results that these events have."""

    def __init__(self, events: Sequence[Line]) -> None:
        arguments: dict[str, dict[str, list[object]]] = {}
        results: dict[str, list[object]] = {}
        for line in events:
            for name, value in line.get("arguments", {}).items():
                arguments.setdefault(line["skill"], {}).setdefault(name, []).append(value)
            if line.get("result") is not None:
                results.setdefault(line["skill"], []).append(line["result"])
        self._arguments = {
            skill: {name: schema_of(values) for name, values in given.items()}
            for skill, given in arguments.items()
        }
        self._results = {skill: schema_of(values) for skill, values in results.items()}

    def item(self, line: Line) -> Item:
        """The message of a skill's event."""
        skill = line["skill"]
        arguments, result = self._arguments.get(skill, {}), self._results.get(skill)
        message = {"number": line["number"], "event": line["event"], "clock": line["clock"]}
        if "arguments" in line:
            given = line["arguments"].items()
            message["arguments"] = {name: _fitting(value, arguments[name]) for name, value in given}
        if result is not None and line.get("result") is not None:
            message["result"] = _fitting(line["result"], result)
        text = next((str(line[key]) for key in DETAILS if key in line), None)
        if text is not None:
            message["text"] = f"{line['kind']}: {text}" if "kind" in line else text
        properties = {
            "number": WHOLE,
            "event": TEXT,
            "clock": NUMBER,
            "text": TEXT,
            "arguments": {"type": "object", "properties": arguments},
            **({} if result is None else {"result": result}),
        }
        return Item(f"/skill/{skill}", message, {"type": "object", "properties": properties})


class _Way:
    """The rooms, and the robot's way through them."""

    def __init__(self) -> None:
        self._progress = Progress()
        self._world: World | None = None
        self._at: Point | None = None

    def items(self, line: Line, at: int) -> Iterator[Item]:
        """The messages of an event that tells of rooms, or after which the robot is elsewhere."""
        if line["event"] == "map":
            self._world = map_from(line)
            yield Item(ROOMS, foxglove.scene_update(self._world.rooms, at), "foxglove.SceneUpdate")
        else:
            self._progress = self._progress.after(line)
        now, before = self._position(), self._at
        if now is None or now == before:
            return
        self._at = now
        heading = 0.0 if before is None else math.atan2(now[1] - before[1], now[0] - before[0])
        yield Item(POSE, foxglove.pose_in_frame(now, heading, at), "foxglove.PoseInFrame")
        yield Item(FRAMES, foxglove.frame_transform(now, heading, at), "foxglove.FrameTransform")

    def _position(self) -> Point | None:
        if self._world is None:
            return self._progress.at
        return position(self._progress, self._world, RoomMap.of(self._world))


def schema_of(values: Sequence[object]) -> dict[str, Any]:
    """The schema of arguments or results; text where their types differ, since Foxglove takes no unions."""
    lists = [value for value in values if isinstance(value, list)]
    if len(lists) == len(values):
        return {"type": "array", "items": {"type": _type([one for each in lists for one in each])}}
    return {"type": _type(values)}


def _type(values: Sequence[object]) -> str:
    types = {_type_of(value) for value in values}
    if types == {"integer", "number"}:
        return "number"
    return types.pop() if len(types) == 1 else "string"


def _type_of(value: object) -> str:
    is_endless = isinstance(value, float) and not math.isfinite(value)  # JSON has no such numbers
    return "string" if is_endless else TYPES.get(type(value), "string")


def _fitting(value: object, schema: Mapping[str, Any]) -> object:
    """The value, as text where the schema says so."""
    if schema["type"] == "array" and isinstance(value, list):
        return [_fitting(one, schema["items"]) for one in value]
    return value if schema["type"] != "string" or isinstance(value, str) else str(value)


def _about(summary: Summary) -> dict[str, str]:
    began = datetime.fromtimestamp(summary.created).astimezone()
    names = ("id", "state", "reason", "robot", "instruction", "model")
    about = {name: str(getattr(summary, name)) for name in names}
    about["began"] = began.isoformat(timespec="seconds")
    return {name: text.encode(errors="backslashreplace").decode() for name, text in about.items()}


def export(
    path: Path,
    summary: Summary,
    events: Sequence[Line],
    clock: Clock,
    folder: Path | None = None,
) -> None:
    """Write a mission as an MCAP file, whole or not at all; raises UserError if another file is there."""
    path = path.resolve()
    expect_replaceable(path, b"\x89MCAP")
    path.parent.stat()  # no folder is created where a name is mistyped
    whole = io.BytesIO()
    write_mcap(whole, summary, events, folder=folder, clock=clock)
    if path.exists() and not path.is_file():
        path.write_bytes(whole.getvalue())
        return
    temporary = path.with_name(f".{uuid4().hex}.mcap")  # no file of the user's, and no name that is too long
    with open_replacement(path, temporary) as file:
        file.write(whole.getvalue())
