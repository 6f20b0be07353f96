"""Missions are exported as MCAP: each event is a message that fits its schema and has a time."""

from __future__ import annotations

import io
import json
import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from codebotler.core.world import Person, Room, World
from codebotler.missions.mission import Mission
from codebotler.missions.storage.log import LogLine, MissionSummary, read_events
from codebotler.missions.storage.mcap import TimeSource, export_mcap, write_mcap
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated

HALL = Room("hall", footprint=((0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0)), stand_at=(1.0, 1.0))
KITCHEN = Room(
    "kitchen", ("mug",), (Person("ann", ("yes",)),), ((4.0, 0.0), (8.0, 0.0), (8.0, 4.0)), (6.0, 1.0)
)
WORLD = World((HALL, KITCHEN), "hall")
PROGRAM = """def task_program():
    go_to("kitchen")
    if is_in_room("mug"):
        ask("ann", "Tea?", ["No", "Yes"])
    time.sleep(5)
    get_all_rooms()
    try:
        go_to("cellar")
    except Exception as error:
        say(str(error))
"""
JSON_TYPES: dict[str, type | tuple[type, ...]] = {
    "string": str,
    "number": (int, float),
    "integer": int,
    "boolean": bool,
    "array": list,
    "object": dict,
}
LEVELS = {"INFO": 2, "WARNING": 3, "ERROR": 4}


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> tuple[MissionSummary, list[LogLine]]:
    home = tmp_path_factory.mktemp("home")
    with Reservation(Simulated(WORLD, speed=None), home) as reserved:
        with Mission(home, "simulated", "bring tea") as mission:
            mission.log_map(WORLD)
            mission.set_program(PROGRAM, "recorded:careful")
            mission.record_check([])
            mission.note("a word")
            mission.approve()
            mission.run(reserved)
        return mission.summary, read_events(mission.folder)


def read(data: bytes) -> list[tuple[str, dict[str, Any], dict[str, Any], int]]:
    """Return topic, schema, data and time of each message."""
    found = []
    for schema, channel, message in make_reader(io.BytesIO(data)).iter_messages():
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        found.append((channel.topic, json.loads(schema.data), json.loads(message.data), message.log_time))
    return found


def encode(mission: tuple[MissionSummary, list[LogLine]], clock: TimeSource = "wall") -> bytes:
    file = io.BytesIO()
    write_mcap(file, *mission, clock=clock)
    return file.getvalue()


def messages_on(topic: str, data: bytes) -> list[dict[str, Any]]:
    return [message for found, _, message, _ in read(data) if found == topic]


def is_valid(value: object, schema: dict[str, Any]) -> bool:
    """Return whether a value fits its schema, which must describe every field."""
    if isinstance(value, dict):
        return schema["type"] == "object" and all(
            name in schema["properties"] and is_valid(one, schema["properties"][name])
            for name, one in value.items()
        )
    if isinstance(value, list):
        return schema["type"] == "array" and all(is_valid(one, schema["items"]) for one in value)
    return isinstance(value, JSON_TYPES[schema["type"]])


def test_every_event_of_a_skill_is_a_message_of_its_topic(
    mission: tuple[MissionSummary, list[LogLine]],
) -> None:
    messages = [(topic, m) for topic, _, m, _ in read(encode(mission)) if topic.startswith("/skill/")]
    events = [line for line in mission[1] if "skill" in line]
    assert [(topic, m["event"], m["number"]) for topic, m in messages] == [
        (f"/skill/{line['skill']}", line["event"], line["number"]) for line in events
    ]
    asked = messages_on("/skill/ask", encode(mission))
    assert asked[0]["arguments"] == {"person": "ann", "question": "Tea?", "options": ["No", "Yes"]}
    assert [m.get("result") for m in asked] == [None, "Yes"]


def test_every_message_fits_its_schema(mission: tuple[MissionSummary, list[LogLine]]) -> None:
    topics = {}
    for topic, schema, message, _ in read(encode(mission)):
        assert is_valid(message, schema), (topic, message)
        topics[topic] = schema["properties"]
    asked = topics["/skill/ask"]["arguments"]["properties"]
    assert asked["options"] == {"type": "array", "items": {"type": "string"}}
    assert topics["/skill/is_in_room"]["result"] == {"type": "boolean"}
    assert "result" not in topics["/skill/go_to"]
    assert topics["/robot/pose"]["timestamp"]["title"] == "time"


def test_log_lines_have_a_level_and_the_line_of_the_program(
    mission: tuple[MissionSummary, list[LogLine]],
) -> None:
    found = [
        (m["level"], m["file"], m["line"], m["message"]) for m in messages_on("/mission/log", encode(mission))
    ]
    assert (LEVELS["INFO"], "", 0, "a word") in found
    assert (LEVELS["INFO"], "program.py", 2, 'drives to "kitchen"') in found
    assert (LEVELS["ERROR"], "", 0, 'GoToInvalidLocation: there is no room "cellar"') in found


def test_pose_and_frame_follow_the_robot_on_its_map(mission: tuple[MissionSummary, list[LogLine]]) -> None:
    data = encode(mission)
    poses = messages_on("/robot/pose", data)
    places = [(p["pose"]["position"]["x"], p["pose"]["position"]["y"]) for p in poses]
    assert (places[0], places[-1]) == (HALL.stand_at, KITCHEN.stand_at)
    assert {p["frame_id"] for p in poses} == {"map"}
    frames = messages_on("/tf", data)
    assert [f["translation"] for f in frames] == [p["pose"]["position"] for p in poses]
    assert [f["rotation"] for f in frames] == [p["pose"]["orientation"] for p in poses]
    assert {(f["parent_frame_id"], f["child_frame_id"]) for f in frames} == {("map", "robot")}


def test_robot_without_a_map_has_the_poses_that_it_reports(
    mission: tuple[MissionSummary, list[LogLine]],
) -> None:
    lines: list[LogLine] = [
        {
            "time": 1.0,
            "clock": 0.0,
            "event": "feedback",
            "number": 1,
            "skill": "go_to",
            "text": f"at ({x}, {y})",
        }
        for x, y in ((1, 1), (1, 1), (1, 4))
    ]
    data = encode((mission[0], lines))
    poses = [m["pose"] for m in messages_on("/robot/pose", data)]
    assert [p["position"] for p in poses] == [{"x": 1.0, "y": 1.0, "z": 0.0}, {"x": 1.0, "y": 4.0, "z": 0.0}]
    quarter_turn = {"x": 0.0, "y": 0.0, "z": pytest.approx(0.5**0.5), "w": pytest.approx(0.5**0.5)}
    assert poses[1]["orientation"] == quarter_turn
    assert messages_on("/rooms", data) == []


def test_rooms_are_outlines_with_names(mission: tuple[MissionSummary, list[LogLine]]) -> None:
    (update,) = messages_on("/rooms", encode(mission))
    entities = {entity["id"]: entity for entity in update["entities"]}
    assert {(entity["frame_id"], entity["texts"][0]["text"]) for entity in entities.values()} == {
        ("map", "hall"),
        ("map", "kitchen"),
    }
    (outline,) = entities["kitchen"]["lines"]
    assert tuple((point["x"], point["y"]) for point in outline["points"]) == KITCHEN.footprint


def test_foxglove_knows_every_field_of_its_messages(mission: tuple[MissionSummary, list[LogLine]]) -> None:
    json_format = pytest.importorskip("google.protobuf.json_format", reason="of a package for tests")
    seen = set()
    for schema, _, message in make_reader(io.BytesIO(encode(mission))).iter_messages():
        assert schema is not None
        if schema.name.startswith("foxglove."):
            name = schema.name.removeprefix("foxglove.")
            theirs = pytest.importorskip(f"foxglove_schemas_protobuf.{name}_pb2", reason="for tests")
            json_format.ParseDict(with_protobuf_times(json.loads(message.data)), getattr(theirs, name)())
            seen.add(name)
    assert seen == {"PoseInFrame", "FrameTransform", "SceneUpdate", "Log"}


def with_protobuf_times(value: object) -> object:
    """Return the message with times as protobuf writes them in JSON."""
    if isinstance(value, list):
        return [*map(with_protobuf_times, value)]
    if not isinstance(value, dict):
        return value
    if value.keys() == {"sec", "nsec"}:
        seconds, nanoseconds = value["sec"], value["nsec"]
        moment = f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{nanoseconds:09}Z"
        return moment if seconds else f"{seconds}.{nanoseconds:09}s"  # Only durations have 0 seconds.
    return {name: with_protobuf_times(one) for name, one in value.items()}


def test_messages_are_timed_by_either_clock(mission: tuple[MissionSummary, list[LogLine]]) -> None:
    summary, events = mission
    began = round(summary.created * 1e9)
    wall = [time for topic, *_, time in read(encode(mission, "wall")) if topic.startswith("/skill/")]
    robot = [
        time - began for topic, *_, time in read(encode(mission, "robot")) if topic.startswith("/skill/")
    ]
    skills = [line for line in events if "skill" in line]
    assert wall == [round(line["time"] * 1e9) for line in skills]
    assert robot == pytest.approx([line["clock"] * 1e9 for line in skills], abs=1_000)
    assert robot[-1] > 10e9 > wall[-1] - wall[0]


def test_program_and_instruction_are_in_the_file(mission: tuple[MissionSummary, list[LogLine]]) -> None:
    reader = make_reader(io.BytesIO(encode(mission)))
    (program,) = reader.iter_attachments()
    assert (program.name, program.media_type, program.data.decode()) == (
        "program.py",
        "text/x-python",
        PROGRAM,
    )
    (about,) = reader.iter_metadata()
    assert about.metadata["instruction"] == "bring tea"
    assert about.metadata["state"] == "done"


def events_of_skill(skill: str, *calls: tuple[dict[str, object], object]) -> list[LogLine]:
    """Make the events of calls of a skill, each with its arguments and its result."""
    lines: list[LogLine] = []
    for number, (arguments, result) in enumerate(calls, 1):
        which: LogLine = {"time": float(number), "clock": 0.0, "number": number, "skill": skill}
        lines.append({**which, "event": "skill", "arguments": arguments})
        lines.append({**which, "event": "result", "result": result})
    return lines


def test_own_skills_keep_names_arguments_and_results(mission: tuple[MissionSummary, list[LogLine]]) -> None:
    given = {"event": "party", "coats": 2, "colours": ["red", "blue"], "is_wet": True, "text": "hi"}
    data = encode((mission[0], events_of_skill("paint", (given, [0.5, 1]))))
    called, ended = messages_on("/skill/paint", data)
    assert (called["event"], called["arguments"]) == ("skill", given)
    assert (ended["event"], ended["result"]) == ("result", [0.5, 1])
    schema = next(schema["properties"] for topic, schema, *_ in read(data) if topic == "/skill/paint")
    assert schema["result"] == {"type": "array", "items": {"type": "number"}}
    assert {name: one["type"] for name, one in schema["arguments"]["properties"].items()} == {
        "event": "string",
        "coats": "integer",
        "colours": "array",
        "is_wet": "boolean",
        "text": "string",
    }


def test_values_without_a_common_type_are_texts(mission: tuple[MissionSummary, list[LogLine]]) -> None:
    calls: list[tuple[dict[str, object], object]]
    calls = [({"to": "door", "at": 1}, math.inf), ({"to": 3, "at": 0.5}, 2.5), ({"to": [], "at": 2}, None)]
    data = encode((mission[0], events_of_skill("turn", *calls)))
    for _, schema, message, _ in read(data):
        assert is_valid(message, schema)
    messages = messages_on("/skill/turn", data)
    assert [m["arguments"] for m in messages if "arguments" in m] == [
        {"to": "door", "at": 1},
        {"to": "3", "at": 0.5},
        {"to": "[]", "at": 2},
    ]
    assert [m["result"] for m in messages if "result" in m] == ["inf", "2.5"]
    assert b"Infinity" not in data


def test_any_text_and_any_time_can_be_written(mission: tuple[MissionSummary, list[LogLine]]) -> None:
    summary = replace(mission[0], instruction="go \udcff there", reason="\ud800", program="say('\ud800')")
    line: LogLine = {"time": 1.0, "clock": 1e300, "event": "log", "text": "\ud800"}
    ((topic, _, message, time),) = read(encode((summary, [line]), "robot"))
    assert (topic, message["message"]) == ("/mission/log", "\\ud800")
    assert time < 2**63
    (about,) = make_reader(io.BytesIO(encode((summary, [line])))).iter_metadata()
    assert about.metadata["instruction"] == "go \\udcff there"


def test_export_keeps_links_and_pipes(mission: tuple[MissionSummary, list[LogLine]], tmp_path: Path) -> None:
    link, pipe = tmp_path / "link.mcap", tmp_path / "pipe"
    link.symlink_to("mission.mcap")
    export_mcap(link, *mission, "wall")
    assert link.is_symlink()
    assert (tmp_path / "mission.mcap").read_bytes() == encode(mission)
    os.mkfifo(pipe)
    with ThreadPoolExecutor(1) as reader:
        got = reader.submit(pipe.read_bytes)
        export_mcap(pipe, *mission, "wall")
        assert got.result(30) == encode(mission)
    assert pipe.is_fifo()
    read, write = os.pipe()
    export_mcap(Path(f"/dev/fd/{write}"), *mission, "wall")
    os.close(write)
    with os.fdopen(read, "rb") as output:
        assert output.read() == encode(mission)


def test_file_is_written_whole_or_not_at_all(
    mission: tuple[MissionSummary, list[LogLine]], tmp_path: Path
) -> None:
    path = tmp_path / "mission.mcap"
    export_mcap(path, *mission, "wall")
    assert path.read_bytes() == encode(mission)
    before = path.read_bytes()
    with pytest.raises(KeyError):
        export_mcap(path, mission[0], [{"event": "state"}], "wall")
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["mission.mcap"]


def test_no_other_file_is_touched(mission: tuple[MissionSummary, list[LogLine]], tmp_path: Path) -> None:
    path, other = tmp_path / f"{'m' * 245}.mcap", tmp_path / f"{'m' * 245}.mcap.new"
    other.write_text("of the user")
    export_mcap(path, *mission, "wall")
    assert other.read_text() == "of the user"
    assert sorted(tmp_path.iterdir()) == [path, other]
    assert path.stat().st_mode == other.stat().st_mode
