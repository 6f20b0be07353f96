"""Fixtures for tests on ROS 2; without rclpy, they are skipped and say why."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import gettempdir

import pytest

from codebotler.core.skills.paper import SKILLS
from codebotler.robots.ros.kinds import INSTALL_ROS2, ROS2_MODULES
from codebotler.robots.ros.worker import find_missing
from forked_on_ros import forking
from ros2_scene import PROFILE, ROS2_PYTHON, Scene, installed
from ros_graph import forget_goals

HERE = Path(__file__).parent
DOMAINS = range(41, 100)  # Each test process has a separate graph.


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    missing = find_missing(ROS2_PYTHON, ROS2_MODULES)
    if missing is None or missing:
        reason = f"{ROS2_PYTHON} lacks {missing or 'Python'}: {INSTALL_ROS2}"
        for item in items:
            if HERE in item.path.parents:
                item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session", autouse=True)
def ros2_environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch, ExitStack() as locks:
        patch.setenv("ROS_DOMAIN_ID", str(lock_free_domain(locks)))
        # The profile keeps all traffic on loopback; LOCALHOST would add sockets on other addresses to it.
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT")
        patch.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros2")))
        patch.setenv("FASTDDS_DEFAULT_PROFILES_FILE", str(PROFILE))
        actions = [skill.ros for skill in SKILLS.rows if skill.ros is not None]
        installed("robot_actions_pkg", {action.type: action.definition for action in actions})
        with forking(str(ROS2_PYTHON)):
            yield


def lock_free_domain(locks: ExitStack) -> int:
    """Return a domain that no other tests use, and lock it."""
    for domain in DOMAINS:
        lock = locks.enter_context((Path(gettempdir()) / f"codebotler-tests-{domain}.lock").open("w"))
        with suppress(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return domain
    raise AssertionError("no domain is free")


@pytest.fixture
def scene() -> Iterator[Scene]:
    scene = Scene()
    try:
        yield scene
    finally:
        scene.end()
        forget_goals("ros2", os.environ["ROS_DOMAIN_ID"])
