"""What is on a real ROS 1 graph becomes a first file for `--connect`."""

from __future__ import annotations

import pytest
import yaml

from codebotler.core.skills.paper import SKILLS
from codebotler.robots.base import ROS_PYTHON, NotReadyError
from codebotler.robots.ros.connections.discovery import discover_offers, draft_connection
from ros_graph import HERE, Graph, Process


def test_file_has_what_robots_offer(graph: Graph) -> None:
    graph.serve(SKILLS["is_in_room"])
    graph.processes.append(offers := Process(HERE / "ros1_offers.py", master=graph.uri))
    offers.expect("ready")
    text = draft_connection("ros1", discover_offers("ros1", graph.uri, ROS_PYTHON))
    assert yaml.safe_load(text) == {
        "robot": "ros1",
        "pose": {"topic": "/amcl_pose"},
        "skills": {
            "is_in_room": {
                "action": "/is_in_room_server",
                "type": "robot_actions_pkg/IsInRoom",
                "goal": {"object": "$entity"},
                "result": "result",
            },
            "say": {"topic": "/speech", "type": "std_msgs/String", "message": {"data": "$message"}},
        },
    }
    assert "# go_to: {action: /move_base, type: move_base_msgs/MoveBase, " in text
    assert "/elsewhere" not in text
    assert text.partition("# Not mapped:")[2].splitlines() == ["", "#   /battery std_msgs/String"]


def test_graph_without_nodes_is_said(graph: Graph) -> None:
    with pytest.raises(NotReadyError, match=graph.uri):
        discover_offers("ros1", graph.uri, ROS_PYTHON)


def test_missing_master_is_said() -> None:
    with pytest.raises(NotReadyError, match="no ROS master"):
        discover_offers("ros1", "http://localhost:1", ROS_PYTHON)
