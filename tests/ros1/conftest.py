"""Fixtures for tests on ROS 1; without ROS, they are skipped and say why."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from codebotler.robots.base import ROS_PYTHON
from codebotler.robots.ros.kinds import INSTALL_ROS1, ROS1_MODULES
from codebotler.robots.ros.worker import find_missing
from forked_on_ros import forking
from ros_graph import Graph

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    messages = ("move_base_msgs", "nav_msgs", "sensor_msgs", "std_srvs", "tf2_msgs")
    missing = find_missing(ROS_PYTHON, (*ROS1_MODULES, "rosmaster", *messages))
    if missing is None or missing:
        packages = " ".join(f"python3-{name.replace('_', '-')}" for name in messages)
        reason = f"{ROS_PYTHON} lacks {missing or 'Python'}: {INSTALL_ROS1} {packages}"
        for item in items:
            if HERE in item.path.parents:
                item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session", autouse=True)
def ros_home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    home = tmp_path_factory.mktemp("ros")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_HOME", str(home))
        patch.setenv("ROS_LOG_DIR", str(home / "log"))
        patch.setenv("ROS_HOSTNAME", "localhost")
        patch.delenv("ROS_MASTER_URI", raising=False)
        patch.delenv("ROS_IP", raising=False)
        with forking(str(ROS_PYTHON)):
            yield home


@pytest.fixture
def graph() -> Iterator[Graph]:
    graph = Graph()
    try:
        yield graph
    finally:
        graph.end()
