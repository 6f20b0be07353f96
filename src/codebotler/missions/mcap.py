"""Missions as MCAP files, for Foxglove and other tools of roboticists."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import IO, Any, Literal, TypeAlias
from uuid import uuid4

from mcap.writer import Writer

from codebotler import __version__
from codebotler.core.files import expect_replaceable, written_whole
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.skills.values import ValueType
from codebotler.missions.log import Line, Summary
from codebotler.missions.pictures import picture_of

Clock: TypeAlias = Literal["wall", "robot"]
Schema: TypeAlias = Mapping[str, Any]

TEXT: Schema = {"type": "string"}
NUMBER: Schema = {"type": "number"}
SECOND = 1_000_000_000
LATEST = 2**63 - 1024  # nanoseconds since 1970 that every reader can hold
STATES, NOTES = "/mission/state", "/mission/log"
DETAILS = ("text", "message", "reason", "by", "file")
"""The keys of events that hold text."""
IMAGE = "foxglove.CompressedImage"
"""The schema by whose name Foxglove recognises pictures."""
WHOLE: Schema = {"type": "integer"}
TIME: Schema = {"type": "object", "title": "time", "properties": {"sec": WHOLE, "nsec": WHOLE}}
IMAGE_SCHEMA: Mapping[str, Schema] = {
    "timestamp": TIME,
    "frame_id": TEXT,
    "data": {**TEXT, "contentEncoding": "base64"},
    "format": TEXT,
}
FORMATS = {"jpg": "jpeg", "png": "png"}
GOES_ON: Mapping[str, Schema] = {"number": WHOLE, "event": TEXT, "text": TEXT, "clock": NUMBER}


def write_mcap(
    file: IO[bytes],
    summary: Summary,
    events: Sequence[Line],
    *,
    folder: Path | None = None,
    clock: Clock = "wall",
    skills: SkillTable = SKILLS,
) -> None:
    """Write a mission: a channel for each skill and its pictures, one for states, one for the rest.

    The program is attached. Messages are timed by the clock on the wall, or by the robot's, put to start with
    the mission. Pictures lie in its `folder`; None leaves them out.
    """
    began = round(min(summary.created * SECOND, LATEST))
    writer = Writer(file)
    writer.start(profile="", library=f"codebotler {__version__}")
    channels: dict[str, int] = {}

    def time(line: Line) -> int:
        seconds: float = line["time"] if clock == "wall" else summary.created + line["clock"]
        return round(min(seconds * SECOND, LATEST))

    def add(topic: str, properties: Mapping[str, Schema], message: object, at: int, name: str = "") -> None:
        if topic not in channels:
            named = name or "codebotler." + topic.strip("/").replace("/", ".")
            schema = json.dumps({"type": "object", "properties": properties}).encode()
            number = writer.register_schema(named, "jsonschema", schema)
            channels[topic] = writer.register_channel(topic, "json", number)
        writer.add_message(channels[topic], at, json.dumps(message).encode(), at)

    for line in events:
        at = time(line)
        topic, properties, message = _message(line, skills)
        add(topic, properties, message, at)
        if folder is not None and (picture := picture_of(folder, line)) is not None:
            add(f"{topic}/picture", IMAGE_SCHEMA, _image(*picture, at), at, IMAGE)
    last = time(events[-1]) if events else began
    program = summary.program.encode(errors="surrogatepass")
    writer.add_attachment(began, last, "program.py", "text/x-python", program)
    writer.add_metadata("mission", _about(summary))
    writer.finish()  # type: ignore[no-untyped-call]  # theirs


def schema_of(skill: Skill) -> dict[str, Schema]:
    """The properties of messages about a skill: arguments, result and feedback."""
    arguments = {p.name: _schema(p.type) for p in skill.parameters}
    result = {} if skill.returns.base is None else {"result": _schema(skill.returns)}
    return {**GOES_ON, **arguments, **result}


def _schema(value: ValueType) -> Schema:
    one: Schema = {"str": TEXT, "int": WHOLE, "float": NUMBER, "bool": {"type": "boolean"}}[
        value.base or "str"
    ]
    one = {**one, "enum": list(value.choices)} if value.choices else one
    return {"type": "array", "items": one} if value.is_list else one


def _message(line: Line, skills: SkillTable) -> tuple[str, Mapping[str, Schema], dict[str, object]]:
    """The topic, the schema and the message of an event."""
    event, name = line["event"], str(line.get("skill"))
    message: dict[str, object] = {"event": event, "clock": line["clock"]}
    text = next((str(line[key]) for key in DETAILS if key in line), None)
    if text is not None:
        message["text"] = f"{line['kind']}: {text}" if "kind" in line else text
    if name not in skills:
        if event == "state":
            return STATES, {**GOES_ON, "state": TEXT}, {**message, "state": line["state"]}
        if "seconds" in line:
            message["seconds"] = line["seconds"]
        return NOTES, {**GOES_ON, "seconds": NUMBER}, message
    message |= {"number": line["number"], **line.get("arguments", {})}
    if line.get("result") is not None:
        message["result"] = line["result"]
    return f"/skill/{name}", schema_of(skills[name]), message


def _image(kind: str, data: bytes, at: int) -> dict[str, object]:
    """A picture as a message for Foxglove."""
    return {
        "timestamp": {"sec": at // SECOND, "nsec": at % SECOND},
        "frame_id": "",
        "data": base64.b64encode(data).decode(),
        "format": FORMATS[kind],
    }


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
    *,
    skills: SkillTable = SKILLS,
) -> None:
    """Write a mission as an MCAP file, whole or not at all; raises UserError if another file is there."""
    path = path.resolve()
    expect_replaceable(path, b"\x89MCAP")
    path.parent.stat()  # no folder is created where a name is mistyped
    whole = io.BytesIO()
    write_mcap(whole, summary, events, folder=folder, clock=clock, skills=skills)
    if path.exists() and not path.is_file():
        path.write_bytes(whole.getvalue())
        return
    temporary = path.with_name(f".{uuid4().hex}.mcap")  # no file of the user's, and no name that is too long
    with written_whole(path, temporary) as file:
        file.write(whole.getvalue())
