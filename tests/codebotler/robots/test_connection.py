"""Files that connect a robot map its skills to calls, fill in requests, and read results."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.robots.ros.connections.connection import Connection, SkillCall, default_connection
from codebotler.robots.ros.connections.connection_file import read_connection
from codebotler.robots.ros.motion import Motion

GO_TO = "go_to: {action: /drive, type: nav2_msgs/action/NavigateToPose, goal: {pose: $place}}"
SAY = "say: {topic: /speech, type: std_msgs/msg/String, message: {data: $message}}"
PLACES = "frame: map\nplaces: {lab: {x: 1, y: 2}}\n"


def read(folder: Path, text: str) -> Connection:
    (folder / "places.yaml").write_text(PLACES)
    path = folder / "robot.yaml"
    path.write_text(text)
    return read_connection(path, SKILLS)


def test_robot_has_the_skills_that_its_file_maps(tmp_path: Path) -> None:
    text = f"places: places.yaml\npose: {{tf: {{to: base}}}}\nskills:\n  {GO_TO}\n"
    found = read(tmp_path, text)
    assert [*found.skills(SKILLS)] == ["get_current_location", "get_all_rooms", "go_to"]
    assert found.robot == "ros2"
    assert (found.pose, found.frames) == ("/tf", ("map", "base"))
    without_pose = read(tmp_path, text.replace("pose: {tf: {to: base}}\n", ""))
    assert [*without_pose.skills(SKILLS)] == ["get_all_rooms", "go_to"]
    text = "skills:\n  is_in_room: {detector: openai-chat:m, image: /camera}\n"
    assert [*read(tmp_path, text).skills(SKILLS)] == ["is_in_room"]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("skills: {}\n", 1, "skills"),
        ("robot: ros3\nskills:\n  say: {topic: /a, type: a/msg/B}\n", 1, "ros1"),
        ("skills:\n  dance: {topic: /a, type: a/msg/B}\n", 2, "--skills"),
        ("skills:\n  say: {topic: /a}\n", 2, "type"),
        ("skills:\n  say: {topic: /a, action: /b, type: a/msg/B}\n", 2, "one of"),
        ("skills:\n  say: {topic: a b, type: a/msg/B}\n", 2, "ROS name"),
        ("skills:\n  say: {topic: /a, type: String}\n", 2, "package"),
        ("skills:\n  say: {topic: /a, type: a/msg/B, goal: {data: 1}}\n", 2, '"message"'),
        ("skills:\n  say:\n    topic: /a\n    type: a/msg/B\n    message: {data: $text}\n", 5, "$message"),
        ("skills:\n  go_to: {action: /a, type: a/action/B, goal: {pose: $place}}\n", 2, "places"),
        ("skills:\n  ask: {service: /a, type: a/srv/B}\n", 2, "result"),
        ("skills:\n  is_in_room: {detector: m}\n", 2, "image"),
        ("skills:\n  say: {detector: m, image: /a}\n", 2, "detector"),
        ("skills:\n  say: {topic: /a, type: a/msg/B}\n", 2, "$message"),
        ("skills:\n  say: {topic: /a, type: a/msg/B, message: {data: $place.x}}\n", 2, "$message"),
        ("skills:\n  say: {topic: /a, type: a/msg/B, message: {a: $message, a.b: 1}}\n", 2, "path"),
        (f"packages: [nothing]\nskills:\n  {SAY}\n", 1, "folder"),
        (f"keepout: {{mask: /a, info: /b}}\nskills:\n  {SAY}\n", 1, "keepout"),
    ],
)
def test_error_names_the_line(tmp_path: Path, text: str, line: int, words: str) -> None:
    with pytest.raises(UserError) as error:
        read(tmp_path, text)
    assert error.value.line == line
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("kind", "text", "whole"),
    [
        ("action", "move_base_msgs/MoveBase", "move_base_msgs/action/MoveBase"),
        ("action", "move_base_msgs/MoveBaseAction", "move_base_msgs/action/MoveBase"),
        ("action", "move_base_msgs/msg/MoveBaseAction", "move_base_msgs/action/MoveBase"),
        ("action", "lab_msgs/action/TakeAction", "lab_msgs/action/TakeAction"),
        ("service", "std_srvs/Trigger", "std_srvs/srv/Trigger"),
        ("service", "std_srvs/srv/Trigger", "std_srvs/srv/Trigger"),
        ("topic", "std_msgs/String", "std_msgs/msg/String"),
    ],
)
def test_types_are_written_as_on_ros_1_or_2(tmp_path: Path, kind: str, text: str, whole: str) -> None:
    sent = {"action": "goal", "service": "request", "topic": "message"}[kind]
    skill = f"{{{kind}: /a, type: {text}, {sent}: {{data: $message}}}}"
    assert read(tmp_path, f"skills:\n  say: {skill}\n").calls["say"].type == whole


def test_actions_of_ours_need_no_package(tmp_path: Path) -> None:
    for text in ("robot_actions_pkg/Say", "robot_actions_pkg/action/Say"):
        call = read(tmp_path, f"skills:\n  say: {{action: /a, type: {text}, goal: {{m: $message}}}}\n").calls[
            "say"
        ]
        assert call.definition == "string message\n---\n---\n"


def test_fields_are_filled_from_arguments() -> None:
    request = {"pose.x": "$place.x", "pose.y": 2, "names": ["$who", "to $who"], "plain": {"who": "$who"}}
    fields = SkillCall("topic", "/a", "a/msg/B", request).fields({"who": "ann", "place.x": 1.5})
    assert fields == {
        "pose": {"x": 1.5, "y": 2},
        "names": ["ann", "to ann"],
        "plain": {"who": "ann"},
    }


def test_actions_of_the_skill_table_are_calls_as_well() -> None:
    call = default_connection(SKILLS).calls["ask"]
    fields = call.fields({"person": "ann", "question": "tea?", "options": ("yes", "no")})
    assert fields == {"person": "ann", "question": "tea?", "options": ("yes", "no")}
    assert call.answer({"result": "yes"}) == "yes"


@pytest.mark.parametrize(
    ("received", "message"),
    [
        ({"ok": False, "error_code": 206, "error_msg": "in a wall"}, "in a wall (error 206)"),
        ({"ok": False, "error_code": 0, "message": "it jams"}, "it jams"),
        ({"ok": False}, "/open reports a failure"),
    ],
)
def test_error_says_why_a_skill_failed(received: dict[str, Any], message: str) -> None:
    call = SkillCall("service", "/open", "a/srv/B", success="ok", failure="OpenFailed")
    with pytest.raises(RobotError) as error:
        call.answer(received)
    assert (error.value.kind, str(error.value)) == ("OpenFailed", message)


def test_result_is_at_the_path_of_a_field() -> None:
    call = SkillCall("action", "/look", "a/action/B", result="found.0.name", reason="detail.text")
    assert call.answer({"found": [{"name": "mug"}]}) == "mug"
    assert call.why({"detail": {"text": "too dark"}, "message": "other"}) == "too dark"
    with pytest.raises(RobotError, match=r"found\.0\.name"):
        call.answer({"found": []})


def test_robot_is_still_when_it_reports_no_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    seen = Motion()
    states = [(seen.is_still, seen.is_moving)]  # It has reported nothing yet.
    pose = {"is": "pose", "x": 1.0, "y": 0.0, "yaw": math.pi, "frame": "map"}
    for later, said in (
        (0.0, pose),
        (0.4, {"is": "velocity", "speed": 0.5}),
        (0.4, {**pose, "x": 1.01, "yaw": -math.pi}),  # The direction is the same.
        (0.2, {"is": "velocity", "speed": 0.0}),
        (0.1, {**pose, "y": 0.1}),
    ):
        now += later
        seen.record(said)
        states.append((seen.is_still, seen.is_moving))
    now += 1.5
    states.append((seen.is_still, seen.is_moving))  # It reports nothing any more.
    assert seen.is_silent
    assert states == [(False, False), *[(False, True)] * 3, (True, False), (False, True), (False, False)]


def test_robot_is_unseen_when_it_drives_on_without_a_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    seen, unseen = Motion(), []
    for _ in range(4):
        now += 0.3
        seen.record({"is": "velocity", "speed": 1.5})
        unseen.append(seen.is_unseen)
    seen.record({"is": "pose", "x": 1.0, "y": 0.0, "yaw": 0.0, "frame": "map"})
    assert [*unseen, seen.is_unseen] == [False, True, True, True, False]
