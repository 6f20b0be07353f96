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
from codebotler.core.files import expect_replaceable, written_whole
from codebotler.core.world import Point, World
from codebotler.missions import foxglove
from codebotler.missions.foxglove import (
    INTEGER,
    LEVEL_DEBUG,
    LEVEL_ERROR,
    LEVEL_INFO,
    LEVEL_WARNING,
    FLOAT,
    SECOND_NS,
    TEXT,
    Message,
    Schema,
)
from codebotler.missions.log import LogLine, MissionState, MissionSummary
from codebotler.missions.map_event import map_from
from codebotler.missions.pictures import read_picture
from codebotler.missions.progress import Progress, position_on_map
from codebotler.missions.wording import event_text
from codebotler.simulator.sampled_robot import RoomMap

TimeSource: TypeAlias = Literal["wall", "robot"]

_MAX_TIMESTAMP = 2**63 - 1024  # nanoseconds since 1970 that every reader can hold
_STATE_TOPIC, _LOG_TOPIC, _POSE_TOPIC, _FRAME_TOPIC, _ROOM_TOPIC = (
    "/mission/state",
    "/mission/log",
    "/robot/pose",
    "/tf",
    "/rooms",
)
_TEXT_KEYS = ("text", "message", "file")
"""The keys of a skill's events that hold text."""
_LOG_LEVELS = {
    "feedback": LEVEL_DEBUG,
    "error": LEVEL_ERROR,
    **dict.fromkeys(("rule", "stop", "cancelled", "late"), LEVEL_WARNING),
}
"""The levels of log lines, by kind of event; for others it is INFO."""
_STATE_SCHEMA: Schema = {"type": "object", "properties": {"state": TEXT, "reason": TEXT, "clock": FLOAT}}
_JSON_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}


class TopicMessage(NamedTuple):
    """A message for a topic; a schema of Foxglove's goes by its name, others by their topic."""

    topic: str
    message: Message
    schema: Schema | str


def write_mcap(
    file: IO[bytes],
    summary: MissionSummary,
    events: Sequence[LogLine],
    *,
    folder: Path | None = None,
    clock: TimeSource = "wall",
) -> None:
    """Write a mission: a topic for each skill, and topics for states, the log, the robot's pose and rooms.

    The program is attached. Messages are timed by the clock on the wall, or by the robot's, put to start with
    the mission. Pictures lie in its `folder`; None leaves them out.
    """
    began = round(min(summary.created * SECOND_NS, _MAX_TIMESTAMP))
    writer = Writer(file)
    writer.start(profile="", library=f"codebotler {__version__}")
    channels: dict[str, int] = {}
    skills, way = _SkillMessages(events), _RobotPath()

    def time(line: LogLine) -> int:
        seconds: float = line["time"] if clock == "wall" else summary.created + line["clock"]
        return round(min(seconds * SECOND_NS, _MAX_TIMESTAMP))

    def add(topic: str, message: Message, schema: Schema | str, at: int) -> None:
        if topic not in channels:
            name = "codebotler." + topic.strip("/").replace("/", ".")
            name, data = (
                (schema, foxglove.FOXGLOVE_SCHEMAS[schema]) if isinstance(schema, str) else (name, schema)
            )
            number = writer.register_schema(name, "jsonschema", json.dumps(data).encode())
            channels[topic] = writer.register_channel(topic, "json", number)
        writer.add_message(channels[topic], at, json.dumps(message).encode(), at)

    for line in events:
        at = time(line)
        for item in (
            *_event_messages(line, skills, at),
            *_picture_messages(line, folder, at),
            *way.items(line, at),
        ):
            add(*item, at)
    last = time(events[-1]) if events else began
    program = summary.program.encode(errors="surrogatepass")
    writer.add_attachment(began, last, "program.py", "text/x-python", program)
    writer.add_metadata("mission", _metadata(summary))
    writer.finish()  # type: ignore[no-untyped-call]  # theirs


def _event_messages(line: LogLine, skills: _SkillMessages, at: int) -> Iterator[TopicMessage]:
    """The messages about an event: of its skill, of the state, and a line of the log."""
    event = line["event"]
    if "skill" in line:
        yield skills.item(line)
    if event == "state":
        message = {"state": line["state"], "reason": line.get("reason", ""), "clock": line["clock"]}
        yield TopicMessage(_STATE_TOPIC, message, _STATE_SCHEMA)
    text = event_text(line)
    if not text or (event == "sleep" and not line["seconds"]):
        return
    level = LEVEL_ERROR if line.get("state") == MissionState.FAILED else _LOG_LEVELS.get(event, LEVEL_INFO)
    name = str(line.get("skill", event))
    yield TopicMessage(_LOG_TOPIC, foxglove.log_line(level, text, name, line.get("line"), at), "foxglove.Log")


def _picture_messages(line: LogLine, folder: Path | None, at: int) -> Iterator[TopicMessage]:
    if folder is not None and (picture := read_picture(folder, line)) is not None:
        image = foxglove.compressed_image(*picture, at)
        yield TopicMessage(f"/skill/{line['skill']}/picture", image, "foxglove.CompressedImage")


class _SkillMessages:
    """The messages of skills, with schemas of the arguments and results that these events have."""

    def __init__(self, events: Sequence[LogLine]) -> None:
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

    def item(self, line: LogLine) -> TopicMessage:
        """The message of a skill's event."""
        skill = line["skill"]
        arguments, result = self._arguments.get(skill, {}), self._results.get(skill)
        message = {"number": line["number"], "event": line["event"], "clock": line["clock"]}
        if "arguments" in line:
            given = line["arguments"].items()
            message["arguments"] = {name: _fit_schema(value, arguments[name]) for name, value in given}
        if result is not None and line.get("result") is not None:
            message["result"] = _fit_schema(line["result"], result)
        text = next((str(line[key]) for key in _TEXT_KEYS if key in line), None)
        if text is not None:
            message["text"] = f"{line['kind']}: {text}" if "kind" in line else text
        properties = {
            "number": INTEGER,
            "event": TEXT,
            "clock": FLOAT,
            "text": TEXT,
            "arguments": {"type": "object", "properties": arguments},
            **({} if result is None else {"result": result}),
        }
        return TopicMessage(f"/skill/{skill}", message, {"type": "object", "properties": properties})


class _RobotPath:
    """The rooms, and the robot's way through them."""

    def __init__(self) -> None:
        self._progress = Progress()
        self._world: World | None = None
        self._at: Point | None = None

    def items(self, line: LogLine, at: int) -> Iterator[TopicMessage]:
        """The messages of an event that tells of rooms, or after which the robot is elsewhere."""
        if line["event"] == "map":
            self._world = map_from(line)
            yield TopicMessage(
                _ROOM_TOPIC, foxglove.scene_update(self._world.rooms, at), "foxglove.SceneUpdate"
            )
        else:
            self._progress = self._progress.after(line)
        now, before = self._position(), self._at
        if now is None or now == before:
            return
        self._at = now
        heading = 0.0 if before is None else math.atan2(now[1] - before[1], now[0] - before[0])
        yield TopicMessage(_POSE_TOPIC, foxglove.pose_in_frame(now, heading, at), "foxglove.PoseInFrame")
        yield TopicMessage(
            _FRAME_TOPIC, foxglove.frame_transform(now, heading, at), "foxglove.FrameTransform"
        )

    def _position(self) -> Point | None:
        if self._world is None:
            return self._progress.at
        return position_on_map(self._progress, self._world, RoomMap.of(self._world))


def schema_of(values: Sequence[object]) -> dict[str, Any]:
    """The schema of arguments or results; text where their types differ, since Foxglove takes no unions."""
    lists = [value for value in values if isinstance(value, list)]
    if len(lists) == len(values):
        return {"type": "array", "items": {"type": _json_type([one for each in lists for one in each])}}
    return {"type": _json_type(values)}


def _json_type(values: Sequence[object]) -> str:
    types = {_json_type_of(value) for value in values}
    if types == {"integer", "number"}:
        return "number"
    return types.pop() if len(types) == 1 else "string"


def _json_type_of(value: object) -> str:
    is_endless = isinstance(value, float) and not math.isfinite(value)  # JSON has no such numbers
    return "string" if is_endless else _JSON_TYPES.get(type(value), "string")


def _fit_schema(value: object, schema: Mapping[str, Any]) -> object:
    """The value, as text where the schema says so."""
    if schema["type"] == "array" and isinstance(value, list):
        return [_fit_schema(one, schema["items"]) for one in value]
    return value if schema["type"] != "string" or isinstance(value, str) else str(value)


def _metadata(summary: MissionSummary) -> dict[str, str]:
    began = datetime.fromtimestamp(summary.created).astimezone()
    names = ("id", "state", "reason", "robot", "instruction", "model")
    about = {name: str(getattr(summary, name)) for name in names}
    about["began"] = began.isoformat(timespec="seconds")
    return {name: text.encode(errors="backslashreplace").decode() for name, text in about.items()}


def export_mcap(
    path: Path,
    summary: MissionSummary,
    events: Sequence[LogLine],
    clock: TimeSource,
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
    with written_whole(path, temporary) as file:
        file.write(whole.getvalue())
