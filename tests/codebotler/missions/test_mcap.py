"""Missions as MCAP: every event is a message that its schema allows, timed by one clock or the other."""

from __future__ import annotations

import io
import json
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, Skill
from codebotler.core.skills.values import NOTHING, ValueType
from codebotler.core.world import Person, Room, World
from codebotler.missions.log import Line, Summary, events_of
from codebotler.missions.mcap import Clock, export, schema_of, write_mcap
from codebotler.missions.mission import Mission
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated

WORLD = World((Room("hall"), Room("kitchen", ("mug",), (Person("ann", ("yes",)),))), "hall")
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
PLAIN: dict[str, type | tuple[type, ...]] = {
    "string": str,
    "number": (int, float),
    "integer": int,
    "boolean": bool,
    "array": list,
}


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> tuple[Summary, list[Line]]:
    home = tmp_path_factory.mktemp("home")
    with Reservation(Simulated(WORLD, speed=None), home) as reserved:
        with Mission(home, "simulated", "bring tea") as mission:
            mission.draft(PROGRAM, "recorded:careful")
            mission.check([])
            mission.note("a word")
            mission.approve()
            mission.run(reserved)
        return mission.summary, events_of(mission.folder)


def read(data: bytes) -> list[tuple[str, dict[str, Any], dict[str, Any], int]]:
    """Topic, schema, message and time of each message."""
    found = []
    for schema, channel, message in make_reader(io.BytesIO(data)).iter_messages():
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        found.append((channel.topic, json.loads(schema.data), json.loads(message.data), message.log_time))
    return found


def written(mission: tuple[Summary, list[Line]], clock: Clock = "wall") -> bytes:
    file = io.BytesIO()
    write_mcap(file, *mission, clock=clock)
    return file.getvalue()


def test_every_event_is_a_message_of_its_skill(mission: tuple[Summary, list[Line]]) -> None:
    messages = read(written(mission))
    assert len(messages) == len(mission[1])
    for (topic, _, message, _), line in zip(messages, mission[1], strict=True):
        assert message["event"] == line["event"]
        assert topic == (f"/skill/{line['skill']}" if "skill" in line else topic)
    asked = [m for topic, _, m, _ in messages if topic == "/skill/ask"]
    assert [m["event"] for m in asked] == ["skill", "result"]
    assert (asked[0]["options"], asked[1]["result"]) == (["No", "Yes"], "Yes")
    told = {m["text"] for _, _, m, _ in messages if "text" in m}
    assert {"a word", 'GoToInvalidLocation: there is no room "cellar"'} <= told


def test_every_message_is_as_its_schema_says(mission: tuple[Summary, list[Line]]) -> None:
    topics = {}
    for topic, schema, message, _ in read(written(mission)):
        assert schema["type"] == "object"
        for name, value in message.items():
            kind = schema["properties"][name]["type"]
            assert isinstance(value, PLAIN[kind])
        topics[topic] = schema["properties"]
    assert topics["/skill/ask"]["options"] == {"type": "array", "items": {"type": "string"}}
    assert topics["/skill/is_in_room"]["result"] == {"type": "boolean"}
    assert "result" not in topics["/skill/go_to"]


def test_messages_are_timed_by_either_clock(mission: tuple[Summary, list[Line]]) -> None:
    summary, events = mission
    began = round(summary.created * 1e9)
    wall = [time for *_, time in read(written(mission, "wall"))]
    robot = [time - began for *_, time in read(written(mission, "robot"))]
    assert wall == [round(line["time"] * 1e9) for line in events]
    assert robot == pytest.approx([line["clock"] * 1e9 for line in events], abs=1_000)
    assert robot[-1] > 10e9 > wall[-1] - wall[0]


def test_program_and_instruction_are_in_the_file(mission: tuple[Summary, list[Line]]) -> None:
    reader = make_reader(io.BytesIO(written(mission)))
    (program,) = reader.iter_attachments()
    assert (program.name, program.media_type, program.data.decode()) == (
        "program.py",
        "text/x-python",
        PROGRAM,
    )
    (about,) = reader.iter_metadata()
    assert about.metadata["instruction"] == "bring tea"
    assert about.metadata["state"] == "done"


def test_skill_that_is_not_in_the_table_is_a_note(mission: tuple[Summary, list[Line]]) -> None:
    table = SKILLS.with_skill(Skill("wave", (Parameter("hand"),), NOTHING, "Wave."))
    line: Line = {"time": 1.0, "clock": 0.0, "event": "skill", "number": 1, "skill": "wave",
                  "arguments": {"hand": "left"}}  # fmt: skip
    for skills, topic in ((SKILLS, "/mission/log"), (table, "/skill/wave")):
        file = io.BytesIO()
        write_mcap(file, mission[0], [line], skills=skills)
        assert [found for found, *_ in read(file.getvalue())] == [topic]


def test_any_text_and_any_time_can_be_written(mission: tuple[Summary, list[Line]]) -> None:
    odd = replace(mission[0], instruction="go \udcff there", reason="\ud800", program="say('\ud800')")
    line: Line = {"time": 1.0, "clock": 1e300, "event": "log", "text": "\ud800"}
    ((topic, _, message, time),) = read(written((odd, [line]), "robot"))
    assert (topic, message["text"]) == ("/mission/log", "\ud800")
    assert time < 2**63
    (about,) = make_reader(io.BytesIO(written((odd, [line])))).iter_metadata()
    assert about.metadata["instruction"] == "go \\udcff there"


def test_link_and_pipe_stay_what_they_are(mission: tuple[Summary, list[Line]], tmp_path: Path) -> None:
    link, pipe = tmp_path / "link.mcap", tmp_path / "pipe"
    link.symlink_to("mission.mcap")
    export(link, *mission, "wall")
    assert link.is_symlink()
    assert len(read((tmp_path / "mission.mcap").read_bytes())) == len(mission[1])
    os.mkfifo(pipe)
    with ThreadPoolExecutor(1) as reader:
        got = reader.submit(pipe.read_bytes)
        export(pipe, *mission, "wall")
        assert len(read(got.result(30))) == len(mission[1])
    assert pipe.is_fifo()


def test_file_is_written_whole_or_not_at_all(mission: tuple[Summary, list[Line]], tmp_path: Path) -> None:
    path = tmp_path / "mission.mcap"
    export(path, *mission, "wall")
    assert len(read(path.read_bytes())) == len(mission[1])
    before = path.read_bytes()
    with pytest.raises(KeyError):
        export(path, mission[0], [{"event": "state"}], "wall")
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["mission.mcap"]


def test_no_other_file_is_touched(mission: tuple[Summary, list[Line]], tmp_path: Path) -> None:
    path, other = tmp_path / f"{'m' * 245}.mcap", tmp_path / f"{'m' * 245}.mcap.new"
    other.write_text("of the user")
    export(path, *mission, "wall")
    assert other.read_text() == "of the user"
    assert sorted(tmp_path.iterdir()) == [path, other]
    assert path.stat().st_mode == other.stat().st_mode


def test_values_of_own_skills_have_schemas_of_their_types() -> None:
    given = (
        Parameter("colour", ValueType("str", choices=("red", "blue"))),
        Parameter("coats", ValueType("int")),
    )
    row = Skill("paint", given, ValueType("float", is_list=True), "Paint.")
    schema = schema_of(row)
    assert schema["colour"] == {"type": "string", "enum": ["red", "blue"]}
    assert schema["coats"] == {"type": "integer"}
    assert schema["result"] == {"type": "array", "items": {"type": "number"}}
