"""Missions as MCAP files, for Foxglove and other tools of roboticists."""

from __future__ import annotations

import base64
import errno
import io
import json
import os
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import IO, Any, Literal, TypeAlias
from uuid import uuid4

from mcap.writer import Writer

from codebotler import __version__
from codebotler.core.files import expect_replaceable, written_whole
from codebotler.core.skills import SKILLS, Skill, SkillTable
from codebotler.missions.log import Line, Summary
from codebotler.missions.pictures import picture_of

Clock: TypeAlias = Literal["wall", "robot"]
Schema: TypeAlias = Mapping[str, Any]

TEXT: Schema = {"type": "string"}
TEXTS: Schema = {"type": "array", "items": TEXT}
NUMBER: Schema = {"type": "number"}
TYPES: Mapping[str, Schema] = {"str": TEXT, "list[str]": TEXTS, "bool": {"type": "boolean"}}
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
GOES_ON: Mapping[str, Schema] = {
    "number": {"type": "integer"},
    "event": TEXT,
    "text": TEXT,
    "clock": NUMBER,
}


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

    The program is attached.

    Args:
        file: open for writing.
        summary: of the mission.
        events: in their order.
        folder: of the mission, for its pictures; None to leave them out.
        clock: by which the messages are timed: the wall's, or the robot's, put to start with the mission.
        skills: what the robot could be asked to do.

    Raises:
        OSError: it cannot be written.
    """
    began = round(min(summary.created * SECOND, LATEST))

    def time(line: Line) -> int:
        seconds: float = line["time"] if clock == "wall" else summary.created + line["clock"]
        return round(min(seconds * SECOND, LATEST))

    writer = Writer(file)
    writer.start(profile="", library=f"codebotler {__version__}")
    channels = Channels(writer)
    for number, line in enumerate(events):
        topic, properties, message = _message(line, skills)
        channel = channels.channel(topic, properties)
        at = time(line)
        writer.add_message(channel, at, json.dumps(message).encode(), at, sequence=number)
        if folder is not None and (picture := picture_of(folder, line)) is not None:
            channel = channels.channel(f"{topic}/picture", IMAGE_SCHEMA, IMAGE)
            writer.add_message(channel, at, json.dumps(_image(*picture, at)).encode(), at, sequence=number)
    last = time(events[-1]) if events else began
    name = "program.py"
    writer.add_attachment(began, last, name, "text/x-python", summary.program.encode(errors="surrogatepass"))
    writer.add_metadata("mission", _about(summary))
    writer.finish()  # type: ignore[no-untyped-call]  # theirs


class Channels:
    """The channels of a file, each with a schema of its own."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._numbers: dict[str, int] = {}

    def channel(self, topic: str, properties: Mapping[str, Schema], name: str = "") -> int:
        """The channel of a topic such as `/skill/go_to`, made if it is new."""
        if topic not in self._numbers:
            name = name or "codebotler." + topic.strip("/").replace("/", ".")
            schema = {"type": "object", "properties": properties}
            number = self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
            self._numbers[topic] = self._writer.register_channel(topic, "json", number)
        return self._numbers[topic]


def schema_of(skill: Skill) -> dict[str, Schema]:
    """The properties of messages about a skill: arguments, result and feedback."""
    arguments = {f"{p.name}": TYPES[p.annotation] for p in skill.parameters}
    result = {"result": TYPES[skill.returns]} if skill.returns in TYPES else {}
    return {**GOES_ON, **arguments, **result}


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
    result = {"result": line["result"]} if line.get("result") is not None else {}
    arguments = line.get("arguments", {})
    return (
        f"/skill/{name}",
        schema_of(skills[name]),
        {
            **message,
            "number": line["number"],
            **arguments,
            **result,
        },
    )


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
    about = {
        "id": summary.id,
        "state": summary.state,
        "reason": summary.reason,
        "robot": summary.robot,
        "instruction": summary.instruction,
        "model": summary.model,
        "began": began.isoformat(timespec="seconds"),
    }
    return {name: text.encode(errors="backslashreplace").decode() for name, text in about.items()}


def export(
    path: Path, summary: Summary, events: Sequence[Line], clock: Clock, folder: Path | None = None
) -> None:
    """Write a mission as an MCAP file, whole or not at all; raises UserError if another file is there."""
    path = path.resolve()
    expect_replaceable(path, b"\x89MCAP")
    if not path.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    if path.exists() and not path.is_file():
        whole = io.BytesIO()
        write_mcap(whole, summary, events, folder=folder, clock=clock)
        path.write_bytes(whole.getvalue())
        return
    temporary = path.with_name(f".{uuid4().hex}.mcap")  # no file of the user's, and no name that is too long
    with written_whole(path, temporary) as file:
        write_mcap(file, summary, events, folder=folder, clock=clock)
