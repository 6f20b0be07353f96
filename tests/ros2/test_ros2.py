"""The robot on ROS 2 and all that can go wrong, on a real graph with real action servers of rclpy."""

from __future__ import annotations

import ast
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.robots.base import CameraPicture, CancelledError, NotReadyError, Options, RobotLostError
from codebotler.robots.open import open_robot
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.robot import RosRobot
from codebotler.robots.ros.worker import WORKERS_FOLDER
from ros2_scene import ROS2_PYTHON, Scene, installed
from ros_graph import GO_TO, LONG, SAY, run_in_thread


@pytest.mark.smoke
def test_goal_is_executed_and_the_result_comes_back(scene: Scene) -> None:
    server = scene.serve(*SKILLS.rows)
    robot = scene.robot()
    robot.connect()
    assert robot.missing == {}
    assert robot.perform("go_to", ["the hall"]) is None
    server.expect("goal", "the hall")
    assert robot.perform("get_current_location", []) == ""
    assert robot.perform("get_all_rooms", []) == []
    assert robot.perform("is_in_room", ["mug"]) is False
    assert robot.perform("ask", ["ann", "Tea, „ann”?", ("yes", "no")]) == ""


@pytest.mark.smoke
def test_rejected_or_aborted_goal_is_a_robot_error(scene: Scene) -> None:
    scene.serve(GO_TO)
    robot = scene.robot()
    robot.connect()
    for state in ("abort", "reject"):
        with pytest.raises(RobotError) as error:
            robot.perform("go_to", [state])
        assert error.value.kind == "GoToInvalidLocation"
        assert f"/go_to_server {state}ed " in str(error.value)
    robot.perform("go_to", ["the hall"])


@pytest.mark.smoke
def test_cancel_reaches_the_server_and_nothing_is_performed_before_the_next_connect(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    robot = scene.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
        server.expect("goal", "never")
        robot.cancel()
        server.expect("cancel", "never")
    assert isinstance(ended["error"], CancelledError)
    with pytest.raises(CancelledError):
        robot.perform("go_to", ["the hall"])
    robot.connect()
    robot.perform("go_to", ["the hall"])
    server.expect("goal", "the hall")


def test_cancel_before_the_server_has_accepted_the_goal(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    robot = scene.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["slow"])) as ended:
        server.expect("taking")
        robot.cancel()
        server.expect("goal", "slow")
        server.expect("cancel", "slow")
    assert isinstance(ended["error"], CancelledError)


def test_stop_at_any_moment_leaves_no_goal_running(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    robot = scene.robot()
    robot.connect()
    for moment in range(30):
        with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
            time.sleep(moment / 1000)
            robot.cancel()
        assert isinstance(ended["error"], CancelledError)
        time.sleep(0.05)
        heard = {server.events.get()[0] for _ in range(server.events.qsize())}
        assert heard in (set(), {"goal", "cancel"}), moment  # In any order, and perhaps repeated.
        robot._stopped = False  # It stays connected.


def test_goal_that_another_node_cancels_is_cancelled(scene: Scene) -> None:
    scene.serve(GO_TO)
    robot = scene.robot()
    robot.connect()
    with pytest.raises(CancelledError):
        robot.perform("go_to", ["by somebody else"])


def test_result_after_a_stop_is_ignored(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    robot = scene.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["late"])) as ended:
        server.expect("goal", "late")
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)


def test_robot_that_does_not_stop_is_reported(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    robot = scene.robot(Timeouts(patience=1.0, silence=0.5, longest=20.0))
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never, whatever you say"])) as ended:
        server.expect("goal", "never, whatever you say")
        robot.cancel()
    assert isinstance(ended["error"], RobotLostError)
    assert re.search(r"told to stop.* 1 s", ended["error"].sentence)


def test_goal_that_does_not_end_is_cancelled(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    robot = scene.robot(Timeouts(patience=1.5, silence=0.5, longest=1.0))
    robot.connect()
    with pytest.raises(RobotLostError, match=r"/go_to_server .*\b1 s\b.*cancelled"):
        robot.perform("go_to", ["never"])
    server.expect("goal", "never")
    server.expect("cancel", "never")


def test_goal_that_the_server_ignores_is_reported(scene: Scene) -> None:
    scene.serve(SAY)
    robot = scene.robot(Timeouts(patience=1.0, silence=0.5, longest=20.0))
    robot.connect()
    with pytest.raises(RobotLostError, match=r"accept the goal .*1 s"):
        robot.perform("say", ["ignore"])


def test_missing_server_is_known_before_motion_and_looked_for_again(scene: Scene) -> None:
    scene.serve(GO_TO)
    robot = scene.robot(skills=SKILLS)
    robot.connect()
    assert set(robot.missing) == set(SKILLS) - {"go_to"}
    assert "robot_actions_pkg/action/Say at /say_server" in robot.missing["say"]
    server = scene.serve(SAY)
    robot.perform("say", ["hello"])
    server.expect("goal", "hello")


def test_robot_without_any_server_is_not_ready(scene: Scene) -> None:
    with pytest.raises(NotReadyError, match=r"no action server .*/"):
        scene.robot(Timeouts(patience=0.5, silence=0.5, longest=20.0), skills=SKILLS).connect()


def test_server_that_dies_in_a_goal_is_noticed_and_may_come_back(scene: Scene) -> None:
    scene.serve(GO_TO)
    robot = scene.robot()
    robot.connect()
    with pytest.raises(RobotLostError, match=r"/go_to_server has died: .*graph"):
        robot.perform("go_to", ["die"])
    server = scene.serve(GO_TO)
    robot.perform("go_to", ["the hall"])
    server.expect("goal", "the hall")


def test_second_tool_is_refused_and_the_first_goes_on(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    first = scene.robot()
    first.connect()
    with pytest.raises(NotReadyError, match=r"another codebotler .*node codebotler"):
        scene.robot().connect()
    first.perform("go_to", ["the hall"])
    server.expect("goal", "the hall")


def test_killed_worker_is_replaced_by_one_that_cancels_all(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    robot = scene.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
        server.expect("goal", "never")
        assert robot._worker is not None
        os.kill(robot._worker._process.pid, signal.SIGKILL)
        server.expect("cancel", "never")
    assert isinstance(ended["error"], RobotLostError)
    assert "cancelled all goals" in ended["error"].sentence


TOOL = """
import sys
from pathlib import Path
from codebotler.robots.base import Options
from codebotler.robots.ros import kinds
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
robot = kinds.ros2(Options(ros_python=Path(sys.argv[1]), skills=SkillTable((SKILLS["go_to"],))))
robot.connect()
robot.perform("go_to", ["never"])
"""


def start_tool() -> subprocess.Popen[bytes]:
    source = str(Path(__file__).parents[2] / "src")
    return subprocess.Popen(
        [sys.executable, "-c", TOOL, str(ROS2_PYTHON)], env={**os.environ, "PYTHONPATH": source}
    )


def test_killed_tool_leaves_no_moving_robot(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    with start_tool() as tool:
        server.expect("goal", "never")
        tool.kill()
        killed = time.monotonic()
        server.expect("cancel", "never")
        assert time.monotonic() - killed < 2


def test_goals_of_a_worker_that_was_killed_with_its_tool_are_cancelled_by_the_next(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    with start_tool() as tool:
        server.expect("goal", "never")
        (worker,) = children(tool.pid)
        os.kill(worker, signal.SIGSTOP)  # The worker must not notice that its tool is gone.
        tool.kill()
        os.kill(worker, signal.SIGKILL)
    time.sleep(4)  # The worker has left the graph, and its lock is free.
    with pytest.raises(NotReadyError, match="/go_to_server"):
        scene.robot(skills=SkillTable((SAY,))).connect()  # It cannot cancel the goal.
    robot = scene.robot()
    robot.connect()
    server.expect("cancel", "never")
    robot.disconnect()
    with run_in_thread(lambda: perform_as_other_node(scene)) as ended:
        server.expect("goal", "never")
        robot.connect()
        robot.perform("go_to", ["the hall"])
        server.expect("goal", "the hall")  # No goal is left behind.
        scene.robots[-1].cancel()
    assert isinstance(ended["error"], CancelledError)


def children(process: int) -> list[int]:
    return [int(pid) for pid in Path(f"/proc/{process}/task/{process}/children").read_text().split()]


def perform_as_other_node(scene: Scene) -> None:
    environment = {"ROS_DOMAIN_ID": os.environ["ROS_DOMAIN_ID"]}
    skills = SkillTable((GO_TO,))
    options = Options(ros_python=ROS2_PYTHON, skills=skills)
    other = RosRobot(
        "ros2", environment["ROS_DOMAIN_ID"], "ros2_worker.py", options, environment, node="somebody"
    )
    scene.robots.append(other)
    other.connect()
    other.perform("go_to", ["never"])


def test_suspended_tool_stops_the_robot(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    with start_tool() as tool:
        server.expect("goal", "never")
        tool.send_signal(signal.SIGSTOP)
        server.expect("cancel", "never")
        tool.kill()


def test_installed_package_is_preferred_and_gives_feedback(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert GO_TO.ros is not None
    definition = "string location\n---\n---\nstring near\n"
    monkeypatch.setenv("PYTHONPATH", installed("robot_actions_pkg", {"GoTo": definition}))
    scene.serve_as([["robot_actions_pkg/action/GoTo", "/go_to_server", definition]])
    robot = scene.robot(skills=SkillTable((GO_TO,)))
    robot.connect()
    feedback: list[str | CameraPicture] = []
    robot.perform("go_to", ["feedback"], feedback.append)
    assert feedback == ["near: the hall"]


def test_text_that_no_message_can_hold_is_reported(scene: Scene) -> None:
    server = scene.serve(SAY)
    robot = scene.robot()
    robot.connect()
    for text in ("\ud800", "half\0of it"):
        with pytest.raises(RobotLostError, match=r"/say_server cannot be sent.*(surrogates|NUL)"):
            robot.perform("say", [text])
    robot.perform("say", [r"a \x00 and \0"])
    server.expect("goal", r"a \x00 and \0")


def test_many_goals_in_a_row_and_none_is_lost(scene: Scene) -> None:
    server = scene.serve(GO_TO)
    robot = scene.robot()
    robot.connect()
    for number in range(200):
        robot.perform("go_to", [str(number)])
    assert [server.events.get(timeout=LONG) for _ in range(200)] == [
        ["goal", str(number)] for number in range(200)
    ]


def test_address_is_a_domain() -> None:
    assert open_robot("ros2", Options(address="7")).address == "7"
    with pytest.raises(UserError, match=r'"robot" .*ROS_DOMAIN_ID'):
        open_robot("ros2", Options(address="robot"))


@pytest.mark.parametrize("path", sorted(WORKERS_FOLDER.glob("ros2_*.py")), ids=lambda path: path.stem)
def test_workers_are_read_by_python_3_8(path: Path) -> None:
    ast.parse(path.read_text(), feature_version=(3, 8))
