"""The robot behind a rosbridge double on a real ROS graph.

ROS 2 is tested only against a stand-in for the protocol, because no rosbridge for ROS 2 was available.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.server import ServerConnection

from bridges import Bridge, bridge, ros2_handler, ros_handler
from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.robots.base import CameraPicture, CancelledError, NotReadyError, Options, RobotLostError
from codebotler.robots.reservation import Reservation
from codebotler.robots.ros import kinds
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.robot import RosRobot
from processes import are_gone, children_of
from ros_graph import FEW, GO_TO, SAY, Graph, free_port, run_in_thread

WAITS = Timeouts(patience=5.0, silence=1.5, longest=20.0)


def robot_at(address: str, waits: Timeouts | None = None, skills: SkillTable = FEW) -> RosRobot:
    return kinds.rosbridge(Options(address=address, skills=skills), waits)


@pytest.fixture
def double(graph: Graph) -> Iterator[Bridge]:
    with bridge(ros_handler(graph.uri, tuple(FEW))) as double:
        yield double


@pytest.fixture
def whole_double(graph: Graph) -> Iterator[Bridge]:
    """Start a double that knows the messages of all skills."""
    with bridge(ros_handler(graph.uri)) as double:
        yield double


@pytest.fixture
def robot(double: Bridge) -> Iterator[RosRobot]:
    robot = robot_at(double.address, WAITS)
    yield robot
    robot.disconnect()


def test_goal_is_executed_and_the_result_comes_back(graph: Graph, whole_double: Bridge) -> None:
    server = graph.serve(*SKILLS.rows)
    robot = robot_at(whole_double.address, WAITS, SKILLS)
    robot.connect()
    assert robot.perform("go_to", ["the hall"]) is None
    server.expect("goal", "the hall")
    assert robot.perform("get_all_rooms", []) == []
    assert robot.perform("is_in_room", ["mug"]) is False
    assert robot.perform("ask", ["ann", "tea?", ("yes", "no")]) == ""
    for _ in range(50):
        robot.perform("say", ["hello"])
    robot.disconnect()


def test_no_result_is_lost_when_a_server_connects_late(graph: Graph, robot: RosRobot) -> None:
    server = graph.serve(SAY, KNOWS_LATE="1.0")
    robot.connect()
    robot.perform("say", ["hello"])
    server.expect("goal", "hello")


def test_final_status_is_that_of_the_result(graph: Graph, robot: RosRobot) -> None:
    graph.serve(GO_TO)
    robot.connect()
    for goal, kind, message in (
        ("abort", "GoToInvalidLocation", "the door is shut"),
        ("reject", "GoToInvalidLocation", "not in this gown"),
        ("abort, named", "DoorIsShut", "you have no key"),
    ):
        with pytest.raises(RobotError) as error:
            robot.perform("go_to", [goal])
        assert (error.value.kind, str(error.value)) == (kind, message)


def test_cancel_reaches_the_server_and_nothing_is_performed_before_the_next_connect(
    graph: Graph, robot: RosRobot
) -> None:
    server = graph.serve(GO_TO, SAY)
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
        server.expect("goal", "never")
        robot.cancel()
        server.expect("cancel", "never")
    assert isinstance(ended["error"], CancelledError)
    with pytest.raises(CancelledError):
        robot.perform("say", ["on I go"])
    robot.connect()
    robot.perform("say", ["again"])
    server.expect("goal", "again")


def test_cancel_right_after_the_first_goal_ends_it(graph: Graph, robot: RosRobot) -> None:
    graph.serve(GO_TO)
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
        while robot._number == 0:
            time.sleep(0)
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)


def test_server_that_dies_in_a_goal_is_noticed(graph: Graph, robot: RosRobot) -> None:
    graph.serve(GO_TO)
    robot.connect()
    with pytest.raises(RobotLostError, match=r"/go_to_server has died.* 1\.5 s"):
        robot.perform("go_to", ["die"])


def test_server_that_sends_no_result_is_noticed(graph: Graph, double: Bridge) -> None:
    graph.serve(GO_TO)
    robot = robot_at(double.address, Timeouts(patience=4.0))
    robot.connect()
    with pytest.raises(RobotLostError, match=r"/go_to_server .*no result .*4 s"):
        robot.perform("go_to", ["no result"])
    robot.disconnect()


def test_missing_server_is_reported(graph: Graph, robot: RosRobot) -> None:
    graph.serve(GO_TO)
    robot.connect()
    with pytest.raises(RobotLostError, match=r"no action server .*/say_server"):
        robot.perform("say", ["hello"])


def test_messages_that_the_robot_does_not_know_are_reported(graph: Graph) -> None:
    graph.serve(GO_TO)
    with bridge(ros_handler(graph.uri, ("say",))) as double:
        robot = robot_at(double.address, WAITS, SKILLS)
        robot.connect()
        with pytest.raises(RobotLostError, match="Unable to import robot_actions_pkg/"):
            robot.perform("ask", ["ann", "tea?", ()])
        robot.disconnect()


def test_robot_that_does_not_stop_is_reported(graph: Graph, double: Bridge) -> None:
    server = graph.serve(GO_TO)
    robot = robot_at(double.address, Timeouts(patience=2.0))
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never, whatever you say"])) as ended:
        server.expect("goal", "never, whatever you say")
        robot.cancel()
    assert isinstance(ended["error"], RobotLostError)
    assert re.search(r"told to stop.* 2 s", ended["error"].sentence)
    robot.disconnect()


def test_goal_is_cancelled_over_another_connection_when_one_is_lost(
    graph: Graph, double: Bridge, robot: RosRobot
) -> None:
    server = graph.serve(GO_TO)
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
        server.expect("goal", "never")
        double.cut()
        server.expect("cancel", "never")
    assert isinstance(ended["error"], RobotLostError)
    assert re.search(rf"{double.address} .*lost.*cancelled", ended["error"].sentence)


TOOL = """
import sys
from codebotler.robots.ros import kinds
from codebotler.robots.base import Options
robot = kinds.rosbridge(Options(address=sys.argv[1]))
robot.connect()
robot.perform("get_all_rooms", [])
robot.perform("go_to", ["never"])
"""


def test_killed_tool_leaves_no_moving_robot(graph: Graph, whole_double: Bridge) -> None:
    server = graph.serve(GO_TO, SKILLS["get_all_rooms"])
    source = str(Path(__file__).parents[2] / "src")
    process = subprocess.Popen(
        [sys.executable, "-c", TOOL, whole_double.address], env={**os.environ, "PYTHONPATH": source}
    )
    server.expect("goal", "")
    server.expect("goal", "never")
    workers = children_of(process.pid)
    process.kill()
    killed = time.monotonic()
    server.expect("cancel", "never")
    took = time.monotonic() - killed
    process.wait()
    assert took < 1.0, f"the goal was preempted {took:.2f} s after the tool was killed"
    assert workers
    assert are_gone(workers)


def test_worker_of_a_tool_that_leaves_cancels_nothing(graph: Graph, robot: RosRobot) -> None:
    server = graph.serve(GO_TO)
    robot.connect()
    robot.perform("go_to", ["the hall"])
    workers = children_of(os.getpid())
    robot.disconnect()
    server.expect("goal", "the hall")
    assert server.events.empty()
    assert len(children_of(os.getpid())) < len(workers)


def test_missing_rosbridge_is_reported() -> None:
    address = f"ws://127.0.0.1:{free_port()}"
    with pytest.raises(NotReadyError, match=f"no rosbridge .*{address}"):
        robot_at(address).connect()
    with pytest.raises(NotReadyError, match=r"no rosbridge .*nonsense"):
        robot_at("nonsense").connect()


# --- ROS 2, against a stand-in


@pytest.mark.parametrize("other", ["ws://127.0.0.1:{}/", "WS://LocalHost:{}", "ws://[::1]:{}"])
def test_two_tools_cannot_share_a_robot_despite_other_homes_or_spellings(tmp_path: Path, other: str) -> None:
    with bridge(ros2_handler([])) as double:
        port = double.address.rpartition(":")[2]
        with (
            Reservation(robot_at(double.address), tmp_path / "one"),
            pytest.raises(NotReadyError, match=f"another tool .process {os.getpid()}, since"),
        ):
            Reservation(robot_at(other.format(port)), tmp_path / "two").__enter__()
        with Reservation(robot_at(f"ws://localhost:{port}/"), tmp_path / "two"):
            pass


@pytest.fixture
def requests() -> list[dict[str, Any]]:
    return []


@pytest.fixture
def ros2_robot(requests: list[dict[str, Any]]) -> Iterator[RosRobot]:
    with bridge(ros2_handler(requests)) as double:
        robot = robot_at(double.address, Timeouts(patience=1.0, longest=2.0), SKILLS)
        robot.connect()
        yield robot
        robot.disconnect()


def test_stand_in_for_ros_2_executes_goals(ros2_robot: RosRobot, requests: list[dict[str, Any]]) -> None:
    feedback: list[str | CameraPicture] = []
    assert ros2_robot.perform("ask", ["ann", "tea?", ("yes", "no")], feedback.append) == "yes"
    assert feedback == ["near: the hall"]
    sent = requests[-1]
    assert sent.pop("id")
    assert sent == {
        "op": "send_action_goal",
        "action": "/ask_server",
        "action_type": "robot_actions_pkg/action/Ask",
        "args": {"person": "ann", "question": "tea?", "options": ["yes", "no"]},
        "feedback": True,
    }


def test_stand_in_for_ros_2_aborts_and_refuses(ros2_robot: RosRobot) -> None:
    with pytest.raises(RobotError) as error:
        ros2_robot.perform("go_to", ["abort"])
    assert error.value.kind == "GoToInvalidLocation"
    with pytest.raises(RobotLostError, match="no such action"):
        ros2_robot.perform("go_to", ["unknown"])


@pytest.mark.parametrize(
    "reply", ["{nonsense", '{"op": "action_result", "id": 1, "status": []}', '{"op": [' + "[" * 5_000]
)
def test_stand_in_for_ros_2_survives_its_nonsense(ros2_robot: RosRobot, reply: str) -> None:
    with pytest.raises(RobotLostError, match=r"not finish .*2 s"):
        ros2_robot.perform("go_to", [reply])
    assert ros2_robot.perform("ask", ["ann", "tea?", ("yes", "no")]) == "yes"


@pytest.mark.parametrize(
    "message",
    [
        {"op": "publish", "topic": "/else_server/status", "msg": {"status_list": [{}]}},
        {"op": "publish", "topic": "/say_server/result", "msg": {"status": 5, "result": {}}},
        {"op": "status", "level": "error", "msg": "bad"},
    ],
)
def test_invalid_message_is_survived_and_shown(
    message: dict[str, Any],
) -> None:
    def handle(connection: ServerConnection) -> None:
        for _ in connection:
            connection.send(json.dumps(message))

    with bridge(handle) as double:
        robot = robot_at(double.address, Timeouts(patience=1.0))
        robot.connect()
        with pytest.raises(RobotLostError, match=r"no action server .*/say_server") as error:
            robot.perform("say", ["hello"])
        assert re.search("not a rosbridge message|bad", error.value.sentence)
        robot.disconnect()


@pytest.mark.parametrize(
    ("end", "error"),
    [
        ({"status": 4, "values": {}}, CancelledError),
        ({"status": 6, "values": {}}, CancelledError),
        ({"status": 5, "values": {}}, CancelledError),
        ({"values": "no such goal", "result": False}, RobotLostError),
    ],
)
def test_stand_in_for_ros_2_may_end_a_stopped_goal_in_any_way(
    end: dict[str, Any], error: type[Exception]
) -> None:
    sent = threading.Event()

    def handle(connection: ServerConnection) -> None:
        for text in connection:
            message = json.loads(text)
            if message["op"] == "call_service":
                values = {"version": 2}
                answer = {"op": "service_response", "id": message["id"], "result": True, "values": values}
                connection.send(json.dumps(answer))
            elif message["op"] == "send_action_goal":
                sent.set()
            else:
                connection.send(json.dumps({"op": "action_result", "id": message["id"], **end}))

    with bridge(handle) as double:
        robot = robot_at(double.address)
        robot.connect()
        with run_in_thread(lambda: robot.perform("go_to", ["the hall"])) as ended:
            assert sent.wait(30)
            robot.cancel()
        assert type(ended["error"]) is error
        robot.disconnect()


def test_stand_in_for_ros_2_may_go_on_after_the_connection_is_lost() -> None:
    requests: list[dict[str, Any]] = []
    with bridge(ros2_handler(requests)) as double:
        robot = robot_at(double.address)
        robot.connect()
        with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
            while not any(one["op"] == "send_action_goal" for one in requests):
                time.sleep(0.01)
            double.cut()
        assert isinstance(ended["error"], RobotLostError)
        assert "BY HAND" in ended["error"].sentence
        assert requests[-1]["op"] == "cancel_action_goal", "it tries, but a restarted rosbridge ignores it"
        robot.disconnect()


def test_stand_in_for_ros_2_receives_cancels_after_stops_and_timeouts(
    ros2_robot: RosRobot, requests: list[dict[str, Any]]
) -> None:
    with pytest.raises(RobotLostError, match=r"not finish .*2 s.*cancelled"):
        ros2_robot.perform("go_to", ["never"])
    while len(requests) < 3:
        time.sleep(0.01)
    assert requests[-1]["op"] == "cancel_action_goal"
    with run_in_thread(lambda: ros2_robot.perform("go_to", ["never"])) as ended:
        while len(requests) < 4:
            time.sleep(0.01)
        ros2_robot.cancel()
        while len(requests) < 5:
            time.sleep(0.01)
    assert isinstance(ended["error"], CancelledError)
    assert requests[-1]["id"] == requests[-2]["id"]
