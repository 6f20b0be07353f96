"""What tests on ROS 2 share; where there is no rclpy, they are skipped, and say why."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from codebotler.core.skills.paper import SKILLS
from codebotler.robots.ros.ros2 import INSTALL, NEEDS
from codebotler.robots.ros.worker import lacks
from ros2_scene import PROFILE, ROS2_PYTHON, Scene, installed

HERE = Path(__file__).parent
DOMAIN = 10 + os.getpid() % 90  # each test process has a graph of its own


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    missing = lacks(ROS2_PYTHON, NEEDS)
    if missing is None or missing:
        reason = f"{ROS2_PYTHON} lacks {missing or 'Python'}: {INSTALL}"
        for item in items:
            if HERE in item.path.parents:
                item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session", autouse=True)
def ros2_environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
        # The profile keeps all traffic on loopback; LOCALHOST would add sockets on other addresses to it.
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT")
        patch.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros2")))
        patch.setenv("FASTDDS_DEFAULT_PROFILES_FILE", str(PROFILE))
        actions = [skill.ros for skill in SKILLS.rows if skill.ros is not None]
        installed("robot_actions_pkg", {action.type: action.definition for action in actions})
        yield


@pytest.fixture
def scene() -> Iterator[Scene]:
    scene = Scene()
    try:
        yield scene
    finally:
        scene.end()
