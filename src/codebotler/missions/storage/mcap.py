"""Export missions as MCAP files, for Foxglove and other robotics tools."""

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
from codebotler.missions.display.progress import Progress, position_on_map
from codebotler.missions.display.wording import event_text
from codebotler.missions.storage import foxglove
from codebotler.missions.storage.foxglove import FLOAT, INTEGER, SECOND_NS, TEXT, Message, Schema
from codebotler.missions.storage.log import LogLine, MissionSummary
from codebotler.missions.storage.map_event import map_from
from codebotler.missions.storage.pictures import read_picture
from codebotler.simulator.worlds.room_map import RoomMap

TimeSource: TypeAlias = Literal["wall", "robot"]

MAX_TIME_NS = 2**63 - 1024  # the latest time, in nanoseconds since 1970, that every reader can store
_TEXT_KEYS = ("text", "message", "file")
"""The keys of a skill's event that may hold its text."""
_LOG_LEVELS = {
    "feedback": foxglove.LEVEL_DEBUG,
    "error": foxglove.LEVEL_ERROR,
    **dict.fromkeys(("rule", "stop", "cancelled", "late"), foxglove.LEVEL_WARNING),
}
"""The log levels by kind of event. All other kinds have level INFO."""
_STATE_SCHEMA: Schema = {"type": "object", "properties": {"state": TEXT, "reason": TEXT, "clock": FLOAT}}
_JSON_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}


class TopicMessage(NamedTuple):
    """A message and its topic. `schema` is either the name of a Foxglove schema or a schema of our own."""

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
    """Write a mission with a topic for each skill, and topics for states, the log, poses and the rooms.

    The program is added as an attachment. Times come from the wall clock, or from the robot's clock, which
    then starts when the mission was created. Pictures are read from `folder`, unless it is None.
    """
    began = round(min(summary.created * SECOND_NS, MAX_TIME_NS))
    writer = Writer(file)
    writer.start(profile="", library=f"codebotler {__version__}")
    channels: dict[str, int] = {}
    skills, path = _SkillMessages(events), _RobotPath()

    def time(line: LogLine) -> int:
        seconds: float = line["time"] if clock == "wall" else summary.created + line["clock"]
        return round(min(seconds * SECOND_NS, MAX_TIME_NS))

    def add(topic: str, message: Message, schema: Schema | str, at: int) -> None:
        if topic not in channels:
            name = "codebotler." + topic.strip("/").replace("/", ".")
            name, data = (schema, foxglove.SCHEMAS[schema]) if isinstance(schema, str) else (name, schema)
            number = writer.register_schema(name, "jsonschema", json.dumps(data).encode())
            channels[topic] = writer.register_channel(topic, "json", number)
        writer.add_message(channels[topic], at, json.dumps(message).encode(), at)

    for line in events:
        at = time(line)
        for item in (
            *_about_event(line, skills, at),
            *_about_picture(line, folder, at),
            *path.messages(line, at),
        ):
            add(*item, at)
    last = time(events[-1]) if events else began
    program = summary.program.encode(errors="surrogatepass")
    writer.add_attachment(began, last, "program.py", "text/x-python", program)
    writer.add_metadata("mission", _metadata(summary))
    writer.finish()  # type: ignore[no-untyped-call]  # untyped in the library


def _about_event(line: LogLine, skills: _SkillMessages, at: int) -> Iterator[TopicMessage]:
    """Yield the messages for an event: its skill, its state, and a log line."""
    event = line["event"]
    if "skill" in line:
        yield skills.message(line)
    if event == "state":
        message = {"state": line["state"], "reason": line.get("reason", ""), "clock": line["clock"]}
        yield TopicMessage("/mission/state", message, _STATE_SCHEMA)
    text = event_text(line)
    if not text or (event == "sleep" and not line["seconds"]):
        return
    level = _LOG_LEVELS.get("error" if line.get("state") == "failed" else event, foxglove.LEVEL_INFO)
    message = foxglove.log_line(level, text, str(line.get("skill", event)), line.get("line"), at)
    yield TopicMessage("/mission/log", message, "foxglove.Log")


def _about_picture(line: LogLine, folder: Path | None, at: int) -> Iterator[TopicMessage]:
    if folder is not None and (picture := read_picture(folder, line)) is not None:
        image = foxglove.compressed_image(*picture, at)
        yield TopicMessage(f"/skill/{line['skill']}/picture", image, "foxglove.CompressedImage")


class _SkillMessages:
    """Creates messages for skills, with schemas inferred from all their arguments and results."""

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

    def message(self, line: LogLine) -> TopicMessage:
        """Return the message for an event of a skill."""
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
    """Creates messages for the rooms and the robot's poses."""

    def __init__(self) -> None:
        self._progress = Progress()
        self._world: World | None = None
        self._at: Point | None = None

    def messages(self, line: LogLine, at: int) -> Iterator[TopicMessage]:
        """Yield messages if an event contains the map or changes the robot's position."""
        if line["event"] == "map":
            self._world = map_from(line)
            yield TopicMessage("/rooms", foxglove.scene_update(self._world.rooms, at), "foxglove.SceneUpdate")
        else:
            self._progress = self._progress.after(line)
        now, before = self._position(), self._at
        if now is None or now == before:
            return
        self._at = now
        heading = 0.0 if before is None else math.atan2(now[1] - before[1], now[0] - before[0])
        yield TopicMessage("/robot/pose", foxglove.pose_in_frame(now, heading, at), "foxglove.PoseInFrame")
        yield TopicMessage("/tf", foxglove.frame_transform(now, heading, at), "foxglove.FrameTransform")

    def _position(self) -> Point | None:
        if self._world is None:
            return self._progress.at
        return position_on_map(self._progress, self._world, RoomMap.of(self._world))


def schema_of(values: Sequence[object]) -> dict[str, Any]:
    """Infer a JSON schema from values. Mixed types become text, because Foxglove has no union types."""
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
    is_infinite = isinstance(value, float) and not math.isfinite(value)  # JSON has neither inf nor nan
    return "string" if is_infinite else _JSON_TYPES.get(type(value), "string")


def _fit_schema(value: object, schema: Mapping[str, Any]) -> object:
    """Convert a value to text where the schema requires it."""
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
    """Write an MCAP file atomically. Raise UserError instead of overwriting a file of another kind."""
    path = path.resolve()
    expect_replaceable(path, b"\x89MCAP")
    path.parent.stat()  # fail instead of creating folders for a mistyped path
    whole = io.BytesIO()
    write_mcap(whole, summary, events, folder=folder, clock=clock)
    if path.exists() and not path.is_file():
        path.write_bytes(whole.getvalue())
        return
    temporary = path.with_name(f".{uuid4().hex}.mcap")
    with open_replacement(path, temporary) as file:
        file.write(whole.getvalue())
