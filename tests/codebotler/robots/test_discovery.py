"""The offers of a ROS graph become a first file for `--connect`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from codebotler.core.skills.paper import SKILLS
from codebotler.robots.ros.connections.connection_file import read_connection
from codebotler.robots.ros.connections.discovery import draft_connection

NAV2 = "action /navigate_to_pose nav2_msgs/action/NavigateToPose"


def draft(*offers: str) -> dict[str, Any]:
    """Read the lines that are not in comments."""
    read: dict[str, Any] = yaml.safe_load(draft_connection(offers))
    return read


def comments(*offers: str) -> str:
    lines = draft_connection(offers).splitlines()
    return "\n".join(line.strip() for line in lines if line.lstrip().startswith("#"))


def read_comment(start: str, *offers: str) -> Any:  # noqa: ANN401 - any value of YAML
    """Read a line that is in a comment, without its #."""
    (line,) = [line for line in comments(*offers).splitlines() if line.startswith(f"# {start}: ")]
    return yaml.safe_load(line.removeprefix("# "))[start]


def test_drive_of_nav2_waits_for_places() -> None:
    assert draft(NAV2) == {"robot": "ros2", "skills": None}
    assert read_comment("go_to", NAV2) == {
        "action": "/navigate_to_pose",
        "type": "nav2_msgs/action/NavigateToPose",
        "goal": {"pose": "$place"},
    }
    assert "places: " in comments(NAV2)


def test_own_actions_are_written_with_arguments_and_results() -> None:
    offers = [f"action {s.ros.server} robot_actions_pkg/action/{s.ros.type}" for s in SKILLS.rows if s.ros]
    skills = draft(*offers)["skills"]
    assert skills.keys() == SKILLS.keys()
    kind = "robot_actions_pkg/action"
    assert skills["go_to"] == {
        "action": "/go_to_server",
        "type": f"{kind}/GoTo",
        "goal": {"location": "$location"},
    }
    assert skills["is_in_room"]["result"] == "result"
    assert skills["get_all_rooms"]["goal"] == {}


@pytest.mark.parametrize("name", ["/speech", "/robot/say", "/robot_tts", "/tts/say_text"])
def test_speech_topic_becomes_the_skill_say(name: str) -> None:
    said = {"topic": name, "type": "std_msgs/msg/String", "message": {"data": "$message"}}
    assert draft(f"hears {name} std_msgs/msg/String")["skills"] == {"say": said}


@pytest.mark.parametrize(
    "offer",
    ["sends /speech std_msgs/msg/String", "hears /chatter std_msgs/msg/String", "hears /say lab/msg/Say"],
)
def test_other_text_topics_are_not_speech(offer: str) -> None:
    assert draft(offer)["skills"] is None
    assert offer.split()[1] in comments(offer)


def test_services_are_suggested_as_own_skills() -> None:
    offers = ("service /door/open std_srvs/srv/Trigger", "service /lamp/on std_srvs/srv/SetBool")
    assert draft(*offers)["skills"] is None
    door, lamp = read_comment("open_door", *offers), read_comment("on_lamp", *offers)
    assert door == {
        "service": "/door/open",
        "type": "std_srvs/srv/Trigger",
        "request": {},
        "success": "success",
    }
    assert lamp["request"] == {"data": "$on"}


def test_cameras_wait_for_a_detector() -> None:
    offer = "sends /camera/image_raw sensor_msgs/msg/Image"
    assert read_comment("is_in_room", offer)["image"] == "/camera/image_raw"
    offer = "sends /camera/compressed sensor_msgs/msg/CompressedImage"
    assert read_comment("is_in_room", offer)["image"] == "/camera/compressed"


AMCL = "sends /amcl_pose geometry_msgs/msg/PoseWithCovarianceStamped"
TF, ODOM = "sends /tf tf2_msgs/msg/TFMessage", "sends /odom nav_msgs/msg/Odometry"


def test_pose_comes_from_amcl_or_else_from_tf() -> None:
    assert draft(TF, ODOM, AMCL)["pose"] == {"topic": "/amcl_pose"}
    assert draft(TF, ODOM)["pose"] == {"tf": {"from": "map", "to": "base_link"}}
    assert "# pose: {tf: " in comments(TF, AMCL)
    assert "pose" not in draft(ODOM)
    assert read_comment("pose", ODOM) == {"topic": "/odom"}
    assert draft(ODOM)["velocity"] == {"topic": "/odom"}


def test_only_the_first_of_several_is_written() -> None:
    offers = [f"hears /{name} std_msgs/msg/String" for name in ("tts", "say")]
    assert draft(*offers)["skills"]["say"]["topic"] == "/say"
    assert read_comment("say", *offers)["topic"] == "/tts"


def test_other_offers_are_listed_once_without_ros_internals() -> None:
    offers = (
        "sends /scan sensor_msgs/msg/LaserScan",
        "hears /scan sensor_msgs/msg/LaserScan",
        "service /talker/list_parameters rcl_interfaces/srv/ListParameters",
        "service /go/_action/send_goal lab/action/Go_SendGoal",
        "service /lifecycle_manager/is_active std_srvs/srv/Trigger",
        "service /talker/get_type_description type_description_interfaces/srv/GetTypeDescription",
        "sends /rosout rcl_interfaces/msg/Log",
    )
    text = comments(*offers)
    assert text.count("/scan") == 1
    assert "sensor_msgs/msg/LaserScan" in text
    for absent in ("talker", "_action", "lifecycle", "rosout"):
        assert absent not in text


def test_hostile_names_stay_out_of_the_file() -> None:
    assert (
        draft("hears /x\nskills:\n/say std_msgs/msg/String", "hears /{say std_msgs/msg/String")["skills"]
        is None
    )


def test_draft_connects_a_robot(tmp_path: Path) -> None:
    speech, file = "hears /speech std_msgs/msg/String", tmp_path / "robot.yaml"
    file.write_text(draft_connection([NAV2, TF, ODOM, speech]))
    read = read_connection(file, SKILLS)
    assert (read.robot, {*read.calls}, read.velocity) == ("ros2", {"say"}, "/odom")
    (tmp_path / "places.yaml").write_text("places: {hall: {x: 1, y: 2}}")
    file.write_text(file.read_text().replace("# places:", "places:").replace("# go_to:", "go_to:"))
    assert read_connection(file, SKILLS).calls["go_to"].request == {"pose": "$place"}


def test_own_actions_connect_a_robot(tmp_path: Path) -> None:
    offers = [f"action {s.ros.server} robot_actions_pkg/action/{s.ros.type}" for s in SKILLS.rows if s.ros]
    (tmp_path / "robot.yaml").write_text(draft_connection(offers))
    assert read_connection(tmp_path / "robot.yaml", SKILLS).calls.keys() == SKILLS.keys()


def test_guide_shows_this_draft() -> None:
    page = (Path(__file__).parents[3] / "docs" / "nav2.md").read_text()
    offers = (
        NAV2,
        AMCL,
        ODOM,
        "hears /speech std_msgs/msg/String",
        "service /door/open std_srvs/srv/Trigger",
        "sends /camera/image_raw sensor_msgs/msg/Image",
        "sends /scan sensor_msgs/msg/LaserScan",
    )
    assert f"```yaml\n{draft_connection(offers)}```" in page
