"""Missions on the disk: the next tool closes those of a tool that died, and torn lines are dropped."""

from __future__ import annotations

import errno
import json
import os
import time
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from codebotler.core.files import Appender
from codebotler.missions.mission import Mission
from codebotler.missions.storage.log import (
    EVENTS_FILE,
    SUMMARY_FILE,
    MissionState,
    MissionSummary,
    open_log,
    read_events,
)
from codebotler.missions.storage.store import (
    find_interrupted,
    find_mission,
    last_rest,
    read_missions,
    recover_missions,
    rests_in,
)

IF_TOOL_DIES = "its worker cancelled the goal"


def leave(home: Path, state: MissionState, *events: dict[str, object], torn: str = "") -> Path:
    """Leave the folder of a mission that no tool has open."""
    folder = home / "missions" / "20260102-030405"
    folder.mkdir(parents=True)
    summary = MissionSummary(folder.name, state, "ros1", 1_000.0, if_tool_dies=IF_TOOL_DIES)
    summary.write(folder)
    lines = [json.dumps({"time": 1_000.0 + n, "clock": n / 2, **event}) for n, event in enumerate(events)]
    (folder / EVENTS_FILE).write_text("".join(f"{line}\n" for line in lines) + torn)
    return folder


RUNNING: dict[str, object] = {"event": "state", "state": "running"}
DRIVE: dict[str, object] = {
    "event": "skill",
    "number": 1,
    "skill": "go_to",
    "arguments": {"location": "kitchen"},
}
AT: dict[str, object] = {"event": "feedback", "number": 1, "skill": "go_to", "text": "at (1.0, 2.0)"}
THERE: dict[str, object] = {"event": "result", "number": 1, "skill": "go_to", "result": None}


def test_last_continuation_that_ran_is_the_rest_of_a_mission() -> None:
    def one(name: str, continues: str = "", dies: str = IF_TOOL_DIES) -> MissionSummary:
        return MissionSummary(
            name, MissionState.DONE, "simulated", 1.0, continues=continues, if_tool_dies=dies
        )

    known = [one("1"), one("2", "1", dies=""), one("3", "1"), one("4", "3"), one("5")]
    assert [rest and rest.id for rest in (last_rest(name, rests_in(known)) for name in "12345")] == [
        *("4", None, "4", None, None)
    ]
    circle = rests_in([one("1", "1"), one("2", "1"), one("1", "2")])
    assert last_rest("1", circle) is not None
    earlier = one("1", "2")  # The clock of its computer is slow.
    assert last_rest("2", rests_in([earlier, one("2", "")])) == earlier


@pytest.mark.parametrize(
    ("state", "events", "named"),
    [
        (MissionState.DRAFTING, [], ["before the program ran"]),
        (MissionState.APPROVED, [], ["before the program ran"]),
        (MissionState.RUNNING, [RUNNING, DRIVE, AT], ['go_to("kitchen"), at (1.0, 2.0); ', IF_TOOL_DIES]),
        (MissionState.STOPPING, [RUNNING, DRIVE], ['go_to("kitchen"); ', IF_TOOL_DIES]),
        (MissionState.RUNNING, [RUNNING, DRIVE, AT, THERE], ["robot was idle"]),
    ],
)
def test_mission_of_a_tool_that_died_was_interrupted(
    tmp_path: Path, state: MissionState, events: list[dict[str, object]], named: list[str]
) -> None:
    folder = leave(tmp_path, state, *events, torn='{"time": 17')
    (summary,) = recover_missions(tmp_path)
    assert summary.state == "interrupted"
    assert all(name in summary.reason for name in named), summary.reason
    assert MissionSummary.read(folder) == summary
    *before, last = read_events(folder)
    assert [line["event"] for line in before] == [event["event"] for event in events]
    assert (last["state"], last["reason"]) == ("interrupted", summary.reason)
    assert last["clock"] == (before[-1]["clock"] if before else 0)
    assert recover_missions(tmp_path) == []


def test_mission_that_ended_before_its_summary_was_written_is_not_interrupted(tmp_path: Path) -> None:
    end: dict[str, object] = {"event": "state", "state": "failed", "reason": "odd"}
    folder = leave(tmp_path, MissionState.RUNNING, RUNNING, end)
    assert recover_missions(tmp_path) == []
    summary = MissionSummary.read(folder)
    assert (summary.state, summary.reason, summary.ended) == ("failed", "odd", 1001.0)


def test_mission_of_a_living_tool_is_left_alone(tmp_path: Path) -> None:
    with Mission(tmp_path, "simulated") as mission:
        assert recover_missions(tmp_path) == []
        assert mission.state is MissionState.DRAFTING
        with pytest.raises(BlockingIOError):
            open_log(mission.folder)
    assert recover_missions(tmp_path) == []


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES, errno.ENOSPC])
def test_mission_that_cannot_be_closed_is_reported_and_others_are_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], number: int
) -> None:
    for name in ("20260101-000001", "20260101-000002"):
        leave(tmp_path, MissionState.RUNNING, RUNNING, DRIVE).rename(tmp_path / "missions" / name)

    def open_second(folder: Path) -> Appender:
        if folder.name.endswith("1"):
            raise OSError(number, os.strerror(number), str(folder / EVENTS_FILE))
        return open_log(folder)

    monkeypatch.setattr("codebotler.missions.storage.store.open_log", open_second)
    (summary,) = recover_missions(tmp_path)
    assert summary.state == "interrupted"
    unclosed, closed = capsys.readouterr().err.splitlines()
    assert "20260101-000001" in unclosed
    assert os.strerror(number) in unclosed
    assert " was interrupted: " in closed
    assert [summary.state for summary in read_missions(tmp_path)] == ["running", "interrupted"]


def test_missions_are_read_in_order_of_creation(tmp_path: Path) -> None:
    assert read_missions(tmp_path) == []
    for name in ("b", "a"):
        with Mission(tmp_path, name):
            time.sleep(0.01)
    assert [summary.robot for summary in read_missions(tmp_path)] == ["b", "a"]


def test_the_last_mission_is_found_without_reading_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = leave(tmp_path, MissionState.DONE)
    for suffix in ("-2", "-9", "-10"):
        folder = first.with_name(first.name + suffix)
        folder.mkdir()
        MissionSummary(folder.name, MissionState.DONE, "sim", 1_000.0).write(folder)
    (first / SUMMARY_FILE).write_text("damaged")
    with pytest.raises(UserError):
        read_missions(tmp_path)
    monkeypatch.setattr("codebotler.missions.storage.store.RECENT_MISSIONS", 1)
    assert find_mission(tmp_path, "last").name.endswith("-10")
    assert [one.id[-2:] for one in read_missions(tmp_path, 2)] == ["10", "-9"]  # Sorted by time.


VALID = {"id": "x", "state": "done", "robot": "sim", "created": 1.0}


@pytest.mark.parametrize(
    "text",
    [
        *("", "[]", "{}", '{"id": 3}', "nonsense", '{"id": "x", "state": "odd"', "[" * 100_000),
        *(json.dumps({**VALID, **bad}) for bad in ({"state": "odd"}, {"created": "now"}, {"created": 1e300})),
        *(json.dumps({**VALID, **bad}) for bad in ({"program": 5}, {"problems": [1]}, {"reason": None})),
    ],
)
def test_summary_that_cannot_be_read_is_named(tmp_path: Path, text: str) -> None:
    folder = leave(tmp_path, MissionState.DONE)
    (folder / SUMMARY_FILE).write_text(text)
    with pytest.raises(UserError, match="not a valid mission summary") as error:
        read_missions(tmp_path)
    assert error.value.file == folder / SUMMARY_FILE
    assert recover_missions(tmp_path) == [], "the robot can still work"


@pytest.mark.parametrize(
    "text",
    [
        *("[]", "{}", '{"event": "skill"}', "nonsense", '{"event": 1, "time": 0}', "[" * 100_000),
        *('{"event": [], "time": 1, "clock": 1}', '{"event": "log", "time": 1, "clock": 1}'),
        *('{"event": "skill", "time": 1, "clock": 1}', '{"event": "log", "time": NaN, "clock": 1}'),
    ],
)
def test_event_that_cannot_be_read_is_named(tmp_path: Path, text: str) -> None:
    folder = leave(tmp_path, MissionState.DONE, RUNNING)
    with (folder / EVENTS_FILE).open("a") as file:
        file.write(f"{text}\n")
    with pytest.raises(UserError, match=r"JSON|not a mission event") as error:
        read_events(folder)
    assert (error.value.file, error.value.line) == (folder / EVENTS_FILE, 2)


def test_summary_of_a_later_version_is_read(tmp_path: Path) -> None:
    folder = leave(tmp_path, MissionState.DONE)
    data = json.loads((folder / SUMMARY_FILE).read_text())
    (folder / SUMMARY_FILE).write_text(json.dumps({**data, "colour": "red"}))
    assert read_missions(tmp_path)[0].state == "done"


def test_an_interrupted_mission_is_found_until_a_rest_has_run(tmp_path: Path) -> None:
    interrupted = leave(tmp_path, MissionState.INTERRUPTED)

    def add(number: int, dies: str) -> None:
        folder = interrupted.with_name(f"{interrupted.name}-{number}")
        folder.mkdir()
        MissionSummary(
            folder.name, MissionState.STOPPED, "sim", 1_000.0 + number, "", continues="x", if_tool_dies=dies
        ).write(folder)

    add(2, "")  # This continuation was stopped before it ran.
    assert [one.id for one in find_interrupted(tmp_path)] == [interrupted.name]
    add(3, IF_TOOL_DIES)
    assert find_interrupted(tmp_path) == []
