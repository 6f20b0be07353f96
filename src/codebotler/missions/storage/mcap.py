"""Export missions as MCAP files, for Foxglove and other robotics tools."""

from __future__ import annotations

import base64
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
from codebotler.missions.storage.foxglove import SECOND_NS, Message
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
_JSON_TYPES = {
    dict: "object",
    list: "array",
    bytes: "bytes",
    bool: "boolean",
    int: "integer",
    float: "number",
    str: "string",
}


class TopicMessage(NamedTuple):
    """An MCAP message with its topic and, if Foxglove defines its schema, the schema's name."""

    topic: str
    message: Message
    schema: str = ""


def write_mcap(
    file: IO[bytes],
    summary: MissionSummary,
    events: Sequence[LogLine],
    *,
    folder: Path | None = None,
    clock: TimeSource = "wall",
) -> None:
    """Write a mission as MCAP, with topics for each skill, the states, the log, the poses and the rooms.

    The program is added as an attachment. Times come from the wall clock, or from the robot's clock, counted
    from the creation of the mission. Pictures are read from `folder`, or left out if it is None.
    """
    began = round(min(summary.created * SECOND_NS, MAX_TIME_NS))
    path = _RobotPath()
    written: list[tuple[int, TopicMessage]] = []
    for line in events:
        seconds: float = line["time"] if clock == "wall" else summary.created + line["clock"]
        at = round(min(seconds * SECOND_NS, MAX_TIME_NS))
        found = (*_about_event(line, at), *_about_picture(line, folder, at), *path.messages(line, at))
        written += [(at, one) for one in found]
    writer = Writer(file)
    writer.start(profile="", library=f"codebotler {__version__}")
    _write_messages(writer, written)
    last = written[-1][0] if written else began
    program = summary.program.encode(errors="surrogatepass")
    writer.add_attachment(began, last, "program.py", "text/x-python", program)
    writer.add_metadata("mission", _metadata(summary))
    writer.finish()  # type: ignore[no-untyped-call]  # untyped in the library


def _write_messages(writer: Writer, written: Sequence[tuple[int, TopicMessage]]) -> None:
    """Write messages with their times, and for each topic a schema that fits all of its messages."""
    topics: dict[str, list[TopicMessage]] = {}
    for _, one in written:
        topics.setdefault(one.topic, []).append(one)
    schemas = {topic: schema_of([one.message for one in some]) for topic, some in topics.items()}
    channels: dict[str, int] = {}
    for topic, (first, *_) in topics.items():
        name = first.schema or "codebotler." + topic.strip("/").replace("/", ".")
        number = writer.register_schema(name, "jsonschema", json.dumps(schemas[topic]).encode())
        channels[topic] = writer.register_channel(topic, "json", number)
    for at, one in written:
        data = json.dumps(_fit_schema(one.message, schemas[one.topic])).encode()
        writer.add_message(channels[one.topic], at, data, at)


def _about_event(line: LogLine, at: int) -> Iterator[TopicMessage]:
    """Yield the messages for an event: its skill, its state, and a log line."""
    event = line["event"]
    if "skill" in line:
        yield TopicMessage(f"/skill/{line['skill']}", _skill_message(line))
    if event == "state":
        message = {"state": line["state"], "reason": line.get("reason", ""), "clock": line["clock"]}
        yield TopicMessage("/mission/state", message)
    text = event_text(line)
    if not text or (event == "sleep" and not line["seconds"]):
        return
    level = _LOG_LEVELS.get("error" if line.get("state") == "failed" else event, foxglove.LEVEL_INFO)
    message = foxglove.log_line(level, text, str(line.get("skill", event)), line.get("line"), at)
    yield TopicMessage("/mission/log", message, "foxglove.Log")


def _skill_message(line: LogLine) -> Message:
    message: Message = {name: line[name] for name in ("number", "event", "clock")}
    message |= {name: line[name] for name in ("arguments", "result") if line.get(name) is not None}
    text = next((str(line[key]) for key in _TEXT_KEYS if key in line), None)
    if text is not None:
        message["text"] = f"{line['kind']}: {text}" if "kind" in line else text
    return message


def _about_picture(line: LogLine, folder: Path | None, at: int) -> Iterator[TopicMessage]:
    if folder is not None and (picture := read_picture(folder, line)) is not None:
        image = foxglove.compressed_image(*picture, at)
        yield TopicMessage(f"/skill/{line['skill']}/picture", image, "foxglove.CompressedImage")


class _RobotPath:
    """Creates messages for the rooms and the robot's poses."""

    def __init__(self) -> None:
        self._progress = Progress()
        self._world: World | None = None
        self._at: Point | None = None

    def messages(self, line: LogLine, at: int) -> Iterator[TopicMessage]:
        """Yield the rooms if an event has a map, and the pose if it has changed. `at` is in ns since 1970."""
        if line["event"] == "map":
            self._world = map_from(line)
            rooms = {"entities": [foxglove.scene_entity(room, at) for room in self._world.rooms]}
            yield TopicMessage("/rooms", rooms, "foxglove.SceneUpdate")
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


def schema_of(values: Sequence[Any]) -> dict[str, Any]:
    """Return a JSON schema that fits all values. Mixed types become text, as Foxglove lacks union types."""
    types = {_json_type(value) for value in values}
    kind = types.pop() if len(types) == 1 else "number" if types == {"integer", "number"} else "string"
    if kind == "object":
        names = dict.fromkeys(name for value in values for name in value)
        title = {"title": "time"} if names.keys() == {"sec", "nsec"} else {}  # as in Foxglove's schemas
        found = {name: schema_of([value[name] for value in values if name in value]) for name in names}
        return {"type": kind, **title, "properties": found}
    if kind == "array":
        return {"type": kind, "items": schema_of([item for value in values for item in value])}
    return {"type": "string", "contentEncoding": "base64"} if kind == "bytes" else {"type": kind}


def _json_type(value: object) -> str:
    is_infinite = isinstance(value, float) and not math.isfinite(value)  # JSON has neither inf nor nan
    return "string" if is_infinite else _JSON_TYPES.get(type(value), "string")


def _fit_schema(value: Any, schema: Mapping[str, Any]) -> Any:  # noqa: ANN401 - any value of a message
    """Convert a value to what JSON can hold, and to text where the schema requires it."""
    match schema:
        case {"type": "object"}:
            return {name: _fit_schema(one, schema["properties"][name]) for name, one in value.items()}
        case {"type": "array"}:
            return [_fit_schema(one, schema["items"]) for one in value]
        case {"contentEncoding": "base64"}:
            return base64.b64encode(value).decode()
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
    """Write a mission to an MCAP file, as `write_mcap` does. Raise UserError if `path` has another format."""
    expect_replaceable(path, b"\x89MCAP")
    whole = io.BytesIO()
    write_mcap(whole, summary, events, folder=folder, clock=clock)
    if path.exists() and not path.is_file():  # such as a pipe, whose link /dev/stdout leads to no file
        path.write_bytes(whole.getvalue())
        return
    path = path.resolve()
    path.parent.stat()  # fail instead of creating folders for a mistyped path
    temporary = path.with_name(f".{uuid4().hex}.mcap")
    with open_replacement(path, temporary) as file:
        file.write(whole.getvalue())
