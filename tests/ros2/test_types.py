"""ROS 2 types from installed packages and from folders of definitions, and messages as JSON."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from codebotler.robots.ros.worker import WORKERS_FOLDER
from ros2_scene import HERE, ROS2_PYTHON

SCRIPT = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from channel import SetupError
from rclpy.serialization import deserialize_message, serialize_message
from message_types import as_data
from ros2_types import fill, message_types

names, folders, fillings = json.loads(sys.argv[2])
try:
    kinds, lines = message_types(names, [Path(folder) for folder in folders]), []
except SetupError as error:
    sys.exit(str(error))
for name, part, values in fillings:
    kind = getattr(kinds[name], part) if part else kinds[name]
    try:
        message = fill(kind(), values)
    except SetupError as error:
        lines.append(str(error))
    else:
        lines.append(as_data(deserialize_message(serialize_message(message), kind)))
print(json.dumps(lines))
"""
NAVIGATE, FILTER = "nav2_msgs/action/NavigateToPose", "nav2_msgs/msg/CostmapFilterInfo"
FRAMES, TRIGGER = "tf2_msgs/msg/TFMessage", "std_srvs/srv/Trigger"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
GRID = "nav_msgs/msg/OccupancyGrid"


def fill(names: list[str], *fillings: tuple[str, str, dict[str, Any]], folders: list[Path]) -> list[Any]:
    """Return the data of messages after they went over the wire, or the errors of filling them."""
    asked = json.dumps([names, [str(folder) for folder in folders], fillings])
    command = [str(ROS2_PYTHON), "-c", SCRIPT, str(WORKERS_FOLDER), asked]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise AssertionError(done.stderr)
    lines: list[Any] = json.loads(done.stdout.splitlines()[-1])
    return lines


def test_messages_go_there_and_back() -> None:
    goal, info, frames, trigger, pose, grid = fill(
        [NAVIGATE, FILTER, FRAMES, TRIGGER, POSE, GRID],
        (
            NAVIGATE,
            "Goal",
            {"pose": {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1, "y": 2.5}}}},
        ),
        (FILTER, "", {"type": 1, "multiplier": 1}),
        (FRAMES, "", {"transforms": [{"child_frame_id": "a"}, {"transform": {"translation": {"z": 3}}}]}),
        (TRIGGER, "Response", {"success": True, "message": "open"}),
        (POSE, "", {"pose": {"covariance": [1] * 36}}),
        (GRID, "", {"info": {"width": 2}, "data": [0, -1]}),
        folders=[HERE / "nav2_msgs", HERE / "tf2_msgs"],
    )
    assert goal["pose"]["header"]["frame_id"] == "map"
    assert goal["pose"]["pose"]["position"] == {"x": 1.0, "y": 2.5, "z": 0.0}
    assert (info["type"], info["multiplier"]) == (1, 1.0)
    assert [each["child_frame_id"] for each in frames["transforms"]] == ["a", ""]
    assert frames["transforms"][1]["transform"]["translation"]["z"] == 3.0
    assert trigger == {"success": True, "message": "open"}
    assert pose["pose"]["covariance"] == [1.0] * 36
    assert (grid["info"]["width"], grid["data"]) == (2, [0, -1])


def test_value_that_does_not_fit_is_named_by_its_path() -> None:
    poses, number, text = "geometry_msgs/msg/PoseArray", "std_msgs/msg/UInt8", "std_msgs/msg/String"
    wrong: list[tuple[str, dict[str, Any], str]] = [
        (POSE, {"pose": {"pose": {"position": {"q": 1}}}}, "pose.pose.position.q"),
        (POSE, {"pose": {"pose": {"position": {"x": "1"}}}}, "pose.pose.position.x"),
        (POSE, {"pose": {"covariance": [1, 2]}}, "pose.covariance"),
        (POSE, {"pose": 3}, "pose"),
        (poses, {"poses": [{}, {"position": {"y": []}}]}, "poses[1].position.y"),
        (poses, {"poses": {}}, "poses"),
        (number, {"data": 300}, "data"),
        (text, {"data": 3}, "data"),
    ]
    errors = fill([POSE, poses, number, text], *((name, "", values) for name, values, _ in wrong), folders=[])
    for sentence, (_, _, path) in zip(errors, wrong, strict=True):
        assert f" {path} " in re.sub("[,;]", " ", sentence)


def test_messages_of_the_package_itself_are_built_with_it(tmp_path: Path) -> None:
    (tmp_path / "lab_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "lab_msgs" / "srv").mkdir()
    for name, text in {
        "msg/Cup.msg": "string name\n",
        "msg/Tray.msg": "Cup[] cups  # in a row\nlab_msgs/Cup[<=2] spares\n",
        "msg/Missing.msg": "unknown_msgs/Any any\n",
        "msg/Broken.msg": "cup\n",
        "srv/Serve.srv": "lab_msgs/Tray tray\n---\n",
    }.items():
        (tmp_path / "lab_msgs" / name).write_text(text)
    serve = "lab_msgs/srv/Serve"
    values = {"tray": {"cups": [{"name": "tea"}], "spares": []}}
    assert fill([serve], (serve, "Request", values), folders=[tmp_path / "lab_msgs"]) == [values]
    for name, sentence in (
        ("Missing", r"lab_msgs .*unknown_msgs"),
        ("Broken", "lab_msgs/msg/Broken"),
        ("None", r"lab_msgs/msg/None\.msg"),
    ):
        with pytest.raises(AssertionError, match=sentence) as error:
            fill([f"lab_msgs/msg/{name}"], folders=[tmp_path / "lab_msgs"])
        assert "Traceback" not in str(error.value)


@pytest.mark.parametrize("name", ["lab_msgs/msg/Cup", "std_msgs/msg/Cup"])
def test_type_that_is_missing_is_named(name: str) -> None:
    with pytest.raises(AssertionError, match=r"(lab|std)_msgs") as error:
        fill([name], folders=[])
    assert "Traceback" not in str(error.value)
