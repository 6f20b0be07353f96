"""The robot on ROS 1 and all that can go wrong, on a real graph with real actionlib."""

from __future__ import annotations

import ast
import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, RosAction, Skill, SkillTable
from codebotler.core.skills.values import TRUTH_TYPE, ValueType
from codebotler.robots.base import (
    ROS_PYTHON,
    CameraPicture,
    CancelledError,
    NotReadyError,
    Options,
    RobotLostError,
)
from codebotler.robots.open import open_robot
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.robot import RosRobot
from codebotler.robots.ros.worker import WORKERS_FOLDER
from ros_graph import FEW, GO_TO, LONG, SAY, Graph, free_port, install_action, run_in_thread


def test_goal_is_executed_and_the_result_comes_back(graph: Graph) -> None:
    server = graph.serve(*SKILLS.rows)
    robot = graph.robot(skills=SKILLS)
    robot.connect()
    assert robot.missing == {}
    assert robot.perform("go_to", ["the hall"]) is None
    server.expect("goal", "the hall")
    assert robot.perform("get_current_location", []) == ""
    assert robot.perform("get_all_rooms", []) == []
    assert robot.perform("is_in_room", ["mug"]) is False
    assert robot.perform("ask", ["ann", "tea?", ("yes", "no")]) == ""


def test_rejected_or_aborted_goal_is_a_robot_error(graph: Graph) -> None:
    graph.serve(GO_TO, SKILLS["pick"])
    robot = graph.robot(skills=FEW.with_skill(SKILLS["pick"]))
    robot.connect()
    for goal, kind, message in (
        ("abort", "GoToInvalidLocation", "the door is shut"),
        ("reject", "GoToInvalidLocation", "not in this gown"),
        ("abort, named", "DoorIsShut", "you have no key"),
        ("abort without a word", "GoToInvalidLocation", "/go_to_server aborted .*without a reason"),
    ):
        with pytest.raises(RobotError, match=f"^{message}$") as error:
            robot.perform("go_to", [goal])
        assert error.value.kind == kind
        robot.perform("go_to", ["the hall"])
    with pytest.raises(RobotError) as error:
        robot.perform("pick", ["abort"])
    assert error.value.kind == "PickFailed"  # A skill with several failures names itself.


def test_missing_master_is_reported_at_once() -> None:
    uri = f"http://localhost:{free_port()}"
    with pytest.raises(NotReadyError, match=f"no ROS master .*{uri}"):
        open_robot("ros1", Options(address=uri)).connect()


@pytest.mark.parametrize("uri", ["robot", "http://robot", "http://robot:a", "ws://robot:9090"])
def test_address_that_is_no_uri_is_refused(uri: str) -> None:
    with pytest.raises(UserError, match=r"ROS master.* http://localhost:11311"):
        open_robot("ros1", Options(address=uri))


def test_missing_rospy_is_reported_with_a_fix(graph: Graph) -> None:
    with pytest.raises(NotReadyError, match="No module named"):
        graph.robot(ros_python=Path(sys.executable)).connect()
    with pytest.raises(NotReadyError, match="--ros-python"):
        graph.robot(ros_python=Path("/nowhere/python3")).connect()


def test_robot_without_any_server_is_not_ready(graph: Graph) -> None:
    with pytest.raises(NotReadyError, match=r"offers no skills: .*/"):
        graph.robot().connect()


def test_missing_server_is_known_before_motion_and_looked_for_again(graph: Graph) -> None:
    graph.serve(GO_TO)
    robot = graph.robot(skills=SKILLS)
    robot.connect()
    assert set(robot.missing) == set(SKILLS) - {"go_to"}
    assert "/say_server" in robot.missing["say"]
    with pytest.raises(RobotLostError, match=r"no action server .*/say_server"):
        robot.perform("say", ["hello"])
    server = graph.serve(SAY)
    robot.perform("say", ["hello"])
    server.expect("goal", "hello")


def test_no_result_is_lost_when_a_server_connects_late(graph: Graph) -> None:
    graph.serve(GO_TO)
    robot = graph.robot()
    robot.connect()
    server = graph.serve(SAY, KNOWS_LATE="0.1")
    robot.perform("say", ["hello"])
    server.expect("goal", "hello")


def test_server_with_another_definition_is_reported(graph: Graph) -> None:
    assert GO_TO.ros is not None
    graph.serve(SAY, replace(GO_TO, ros=replace(GO_TO.ros, goal=("string place",))))
    robot = graph.robot()
    robot.connect()
    assert re.search("robot_actions_pkg/GoToAction .*another md5", robot.missing["go_to"])
    assert "say" not in robot.missing
    with pytest.raises(RobotLostError, match="another md5"):
        robot.perform("go_to", ["the hall"])


def test_server_that_died_long_ago_is_reported(graph: Graph) -> None:
    graph.serve(SAY)
    graph.serve(GO_TO).kill()
    robot = graph.robot()
    robot.connect()
    assert "has died" in robot.missing["go_to"]


def test_server_that_dies_in_a_goal_is_noticed_and_may_come_back(graph: Graph) -> None:
    graph.serve(GO_TO)
    robot = graph.robot()
    robot.connect()
    with pytest.raises(RobotLostError, match="/go_to_server has died"):
        robot.perform("go_to", ["die"])
    server = graph.serve(GO_TO)
    robot.perform("go_to", ["the hall"])
    server.expect("goal", "the hall")


@pytest.mark.parametrize(
    ("goal", "named"),
    [
        ("never", r"/go_to_server .*\b1 s\b.*cancelled"),
        ("no result", r"/go_to_server .*no result .*1\.5 s"),
    ],
)
def test_goal_that_does_not_end_is_cancelled(graph: Graph, goal: str, named: str) -> None:
    server = graph.serve(GO_TO)
    longest = 1.0 if goal == "never" else 20.0
    robot = graph.robot(waits=Timeouts(patience=1.5, silence=3.0, longest=longest))
    robot.connect()
    with pytest.raises(RobotLostError, match=named):
        robot.perform("go_to", [goal])
    server.expect("goal", goal)
    if goal == "never":
        server.expect("cancel", goal)


def test_goal_that_the_server_ignores_is_reported(graph: Graph) -> None:
    graph.serve(GO_TO, DEAF="1")
    robot = graph.robot()
    robot.connect()
    with pytest.raises(RobotLostError, match=r"/go_to_server .*accept the goal .*1\.5 s"):
        robot.perform("go_to", ["the hall"])


def test_goal_that_another_node_cancels_is_cancelled(graph: Graph) -> None:
    graph.serve(GO_TO)
    robot = graph.robot()
    robot.connect()
    with pytest.raises(CancelledError):
        robot.perform("go_to", ["by somebody else"])


def test_cancel_reaches_the_server_and_nothing_is_performed_before_the_next_connect(graph: Graph) -> None:
    server = graph.serve(GO_TO, SAY)
    robot = graph.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
        server.expect("goal", "never")
        robot.cancel()
        server.expect("cancel", "never")
    assert isinstance(ended["error"], CancelledError)
    assert not robot.clock.wait(3600)
    with pytest.raises(CancelledError):
        robot.perform("say", ["on I go"])
    robot.cancel()
    robot.connect()
    robot.perform("say", ["again"])
    server.expect("goal", "again")


def test_cancel_right_after_a_goal_always_ends_it(graph: Graph) -> None:
    server = graph.serve(GO_TO)
    robot = graph.robot()
    robot.connect()
    for _ in range(20):
        with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
            while robot._number == 0:
                time.sleep(0)
            robot.cancel()
        assert isinstance(ended["error"], CancelledError)
        robot._stopped, robot._number = False, 0
    robot._stopped = False
    robot.perform("go_to", ["the end"])
    while server.events.get(timeout=LONG) != ["goal", "the end"]:
        pass


def test_cancel_ends_the_wait_for_a_server(graph: Graph) -> None:
    graph.serve(GO_TO)
    robot = graph.robot(waits=Timeouts(patience=2.0))
    robot.connect()
    with run_in_thread(lambda: robot.perform("say", ["hello"])) as ended:
        while robot._number == 0:
            time.sleep(0.01)
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)


def test_result_after_a_stop_is_ignored(graph: Graph) -> None:
    server = graph.serve(GO_TO)
    robot = graph.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["late"])) as ended:
        server.expect("goal", "late")
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)
    robot.connect()
    with pytest.raises(RobotError, match="the door is shut"):
        robot.perform("go_to", ["abort"])


def test_robot_that_does_not_stop_is_reported(graph: Graph) -> None:
    server = graph.serve(GO_TO)
    robot = graph.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never, whatever you say"])) as ended:
        server.expect("goal", "never, whatever you say")
        robot.cancel()
    assert isinstance(ended["error"], RobotLostError)
    assert re.search(r"/go_to_server .*told to stop.*1\.5 s", ended["error"].sentence)


def test_killed_worker_is_replaced_by_one_that_cancels_all(graph: Graph) -> None:
    server = graph.serve(GO_TO)
    robot = graph.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
        server.expect("goal", "never")
        assert robot._worker is not None
        os.kill(robot._worker._process.pid, signal.SIGKILL)
        server.expect("cancel", "never")
    assert isinstance(ended["error"], RobotLostError)
    assert re.search(r"\bros1 worker has died \(signal 9\).*cancelled", ended["error"].sentence)
    robot.connect()
    robot.perform("go_to", ["the hall"])


def test_stop_works_where_the_worker_hangs(graph: Graph) -> None:
    server = graph.serve(GO_TO)
    robot = graph.robot(waits=Timeouts(patience=LONG))  # Its silence is not noticed.
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
        server.expect("goal", "never")
        assert robot._worker is not None
        os.kill(robot._worker._process.pid, signal.SIGSTOP)
        robot.cancel()
        server.expect("cancel", "never")
    assert isinstance(ended["error"], RobotLostError)


def test_stop_works_where_the_worker_hangs_before_it_took_the_goal(graph: Graph) -> None:
    graph.serve(SKILLS["ask"])
    robot = graph.robot(waits=Timeouts(patience=LONG), skills=SkillTable((SKILLS["ask"],)))
    robot.connect()
    assert robot._worker is not None
    os.kill(robot._worker._process.pid, signal.SIGSTOP)
    more_than_a_pipe_holds = ("x" * 10_000,) * 20
    with run_in_thread(lambda: robot.perform("ask", ["ann", "tea?", more_than_a_pipe_holds])) as ended:
        while robot._number == 0:
            time.sleep(0.01)
        robot.cancel()
    assert isinstance(ended["error"], RobotLostError)


def test_hanging_worker_is_noticed_without_a_stop(graph: Graph) -> None:
    server = graph.serve(GO_TO)
    robot = graph.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
        server.expect("goal", "never")
        assert robot._worker is not None
        os.kill(robot._worker._process.pid, signal.SIGSTOP)
        server.expect("cancel", "never")
    assert isinstance(ended["error"], RobotLostError)
    assert re.search(r"\bros1 worker does not answer.*cancelled", ended["error"].sentence)


TOOL = """
import sys
from codebotler.robots.base import Options
from codebotler.robots.open import open_robot
robot = open_robot("ros1", Options(address=sys.argv[1]))
robot.connect()
robot.perform("go_to", ["never"])
"""


def tool(graph: Graph) -> subprocess.Popen[bytes]:
    source = str(Path(__file__).parents[2] / "src")
    return subprocess.Popen([sys.executable, "-c", TOOL, graph.uri], env={**os.environ, "PYTHONPATH": source})


def test_killed_tool_leaves_no_moving_robot(graph: Graph) -> None:
    server = graph.serve(*SKILLS.rows)
    process = tool(graph)
    server.expect("goal", "never")
    process.kill()
    killed = time.monotonic()
    server.expect("cancel", "never")
    took = time.monotonic() - killed
    process.wait()
    assert took < 1.0, f"the goal was preempted {took:.2f} s after the tool was killed"
    graph.robot().connect()


def test_goals_of_a_worker_that_was_killed_with_its_tool_are_cancelled_by_the_next(graph: Graph) -> None:
    server = graph.serve(GO_TO, SAY)
    first = graph.robot()
    first.connect()
    with run_in_thread(lambda: first.perform("go_to", ["never"])):
        server.expect("goal", "never")
        worker, first._worker = first._worker, None  # The tool must not notice.
        assert worker is not None
        worker.kill()
        graph.robot().connect()
        server.expect("cancel", "never")


def test_robot_that_was_left_in_doubt_is_cleared_at_the_next_connection(graph: Graph) -> None:
    server = graph.serve(GO_TO, SAY)
    robot = graph.robot()
    robot.connect()
    with pytest.raises(RobotLostError, match="sent no result"):
        robot.perform("go_to", ["no result"])
    server.expect("goal", "no result")
    robot.disconnect()
    environment = {"ROS_MASTER_URI": graph.uri}
    other = RosRobot(
        "ros1", graph.uri, "ros1_worker.py", Options(skills=FEW), environment, node="somebody_else"
    )
    other.connect()
    with run_in_thread(lambda: other.perform("say", ["never"])) as ended:  # An abandoned goal.
        server.expect("goal", "never")
        robot.connect()
        server.expect("cancel", "never")
    assert isinstance(ended["error"], CancelledError)
    with run_in_thread(lambda: other.perform("say", ["never"])):
        server.expect("goal", "never")
        robot.connect()
        robot.perform("go_to", ["the hall"])
        server.expect("goal", "the hall")  # No goal is in doubt now.
        other.disconnect()


def test_another_press_cancels_all_goals_though_none_is_in_doubt(graph: Graph) -> None:
    """Only a lost robot is asked so, and another client may have moved it since."""
    server = graph.serve(GO_TO, SAY)
    robot, environment = graph.robot(), {"ROS_MASTER_URI": graph.uri}
    options = Options(skills=FEW)
    other = RosRobot("ros1", graph.uri, "ros1_worker.py", options, environment, node="somebody_else")
    other.connect()
    with run_in_thread(lambda: other.perform("go_to", ["never"])) as ended:
        server.expect("goal", "never")
        robot.cancel()
        server.expect("cancel", "never")
    assert isinstance(ended["error"], CancelledError)
    other.disconnect()


CANCELLED = """
from channel import serve
from ros1_worker import Ros1Worker
class Cancelled(Ros1Worker):
    def start(self, goal, arguments):
        goal.cancel()
        super().start(goal, arguments)
serve(Cancelled)
"""


def test_goal_that_is_cancelled_before_it_is_sent_never_is(graph: Graph, tmp_path: Path) -> None:
    server = graph.serve(SAY)
    script = tmp_path / "cancelled.py"
    script.write_text(CANCELLED)
    environment = {"ROS_MASTER_URI": graph.uri, "PYTHONPATH": str(WORKERS_FOLDER)}
    robot = RosRobot("ros1", graph.uri, str(script), Options(skills=FEW), environment)
    robot.connect()
    with pytest.raises(CancelledError):
        robot.perform("say", ["hello"])
    robot.disconnect()
    after = graph.robot()
    after.connect()
    after.perform("say", ["after that"])
    server.expect("goal", "after that")


def test_second_tool_is_refused_and_the_first_goes_on(graph: Graph) -> None:
    graph.serve(GO_TO)
    first, second = graph.robot(), graph.robot()
    first.connect()
    with pytest.raises(NotReadyError, match="node /codebotler at"):
        second.connect()
    first.perform("go_to", ["the hall"])
    first.disconnect()
    second.connect()
    second.perform("go_to", ["the hall"])


def test_goal_is_cancelled_when_another_node_takes_the_name(graph: Graph) -> None:
    server = graph.serve(GO_TO)
    robot = graph.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["never"])) as ended:
        server.expect("goal", "never")
        code = "import rospy, sys; rospy.init_node('codebotler', disable_signals=True); sys.stdin.read()"
        with subprocess.Popen(
            [str(ROS_PYTHON), "-c", code],
            stdin=subprocess.PIPE,
            env={**os.environ, "ROS_MASTER_URI": graph.uri},
        ) as other:
            server.expect("cancel", "never")
            assert other.stdin is not None
            other.stdin.close()
    assert isinstance(ended["error"], CancelledError)


LATE = f"""
import subprocess, sys, time
from channel import serve
from ros1_worker import Ros1Worker
class Late(Ros1Worker):
    def connect(self, start):
        left_behind = super().connect(start)
        other = "import rospy; rospy.init_node('codebotler', disable_signals=True); rospy.sleep({LONG})"
        self.other = subprocess.Popen([sys.executable, "-c", other])
        while not self.graph.has_left():
            time.sleep(0.01)
        return left_behind
    def missing(self):
        missing = super().missing()
        self.other.kill()
        return missing
serve(Late)
"""


def test_tool_whose_name_is_taken_while_it_connects_is_refused(graph: Graph, tmp_path: Path) -> None:
    graph.serve(GO_TO)
    script = tmp_path / "late.py"
    script.write_text(LATE)
    environment = {"ROS_MASTER_URI": graph.uri, "PYTHONPATH": str(WORKERS_FOLDER)}
    robot = RosRobot(
        "ros1", graph.uri, str(script), Options(skills=FEW), environment, waits=Timeouts(patience=LONG)
    )
    began = time.monotonic()
    with pytest.raises(NotReadyError, match="node called /codebotler"):
        robot.connect()
    assert time.monotonic() - began < LONG / 2, "the tool still waits for servers"


def test_text_that_no_message_can_hold_is_reported(graph: Graph) -> None:
    server = graph.serve(SAY)
    robot = graph.robot()
    robot.connect()
    with pytest.raises(RobotLostError, match=r"/say_server .*surrogates"):
        robot.perform("say", ["\ud800"])
    robot.perform("say", ["hello"])
    server.expect("goal", "hello")


def test_restart_of_the_master_between_missions_is_noticed(graph: Graph) -> None:
    graph.serve(GO_TO)
    robot = graph.robot()
    robot.connect()
    robot.perform("go_to", ["the hall"])
    graph.master.end()
    with pytest.raises(NotReadyError, match="no ROS master"):
        graph.robot().connect()
    graph.processes.pop().kill()
    with pytest.raises(RobotLostError, match=r"ROS master|has died"):
        robot.perform("go_to", ["the hall"])
    graph.start_master()
    server = graph.serve(GO_TO)
    with pytest.raises(RobotLostError, match="restarted; connect again"):
        robot.perform("go_to", ["the lab"])
    robot.connect()
    robot.perform("go_to", ["the den"])
    server.expect("goal", "the den")


def test_two_hundred_goals_in_a_row_and_none_is_lost(graph: Graph) -> None:
    server = graph.serve(SAY)
    robot = graph.robot()
    robot.connect()
    for number in range(200):
        robot.perform("say", [str(number)])
    heard = [server.events.get(timeout=LONG) for _ in range(200)]
    assert heard == [["goal", str(number)] for number in range(200)]


def test_ninth_skill_is_performed(graph: Graph) -> None:
    wave = Skill(
        "wave",
        (Parameter("person"), Parameter("ways", ValueType(is_list=True), is_options=True)),
        TRUTH_TYPE,
        "Wave at a person.",
        ros=RosAction("Wave", "/wave_server", ("string person", "string[] ways"), "bool"),
    )
    server = graph.serve(wave)
    robot = graph.robot(skills=SKILLS.with_skill(wave))
    robot.connect()
    assert robot.perform("wave", ["ann", ("left", "right")]) is False
    server.expect("goal", "ann")


def test_installed_messages_are_preferred_and_give_feedback(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    definition = "string location\n---\n---\nstring near\n"
    monkeypatch.setenv("PYTHONPATH", install_action(tmp_path, "GoTo", definition))
    graph.serve(GO_TO, SAY)
    robot = graph.robot()
    robot.connect()
    feedback: list[str | CameraPicture] = []
    robot.perform("go_to", ["feedback"], feedback.append)
    assert feedback == ["near: the hall"]
    robot.perform("say", ["hello"])


MD5 = """
import json, sys
sys.path.insert(0, sys.argv[1])
from message_types import action_types
for name, spec in action_types(json.loads(sys.argv[2])).items():
    a = spec()
    for part in (a, a.action_goal, a.action_result, a.action_feedback,
                 a.action_goal.goal, a.action_result.result, a.action_feedback.feedback):
        print(part._type, part._md5sum, *part.__slots__)
"""
HEADER = "2176decaecbce78abc3b96ef049fabed"
GOAL_ID = "302881f31927c1df708a2dbab0e80ee8"
STATUS = "d388f9b87b3c471f784434d671988d4a"


def test_messages_made_in_memory_are_those_of_the_code_generator() -> None:
    from hashlib import md5  # noqa: PLC0415 - ROS identifies messages by it

    def digest(*lines: str) -> str:
        return md5("\n".join(lines).encode(), usedforsecurity=False).hexdigest()

    actions = [{"type": s.ros.type, "definition": s.ros.definition} for s in SKILLS.rows if s.ros is not None]
    said = subprocess.run(
        [str(ROS_PYTHON), "-c", MD5, str(WORKERS_FOLDER), json.dumps(actions)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    made = {line.split()[0]: line.split()[1:] for line in said.splitlines()}
    assert len(made) == 7 * len(SKILLS)
    for skill in SKILLS.rows:
        assert skill.ros is not None
        name = f"robot_actions_pkg/{skill.ros.type}"
        goal = digest(*skill.ros.goal)
        result = digest(f"{skill.ros.result} result") if skill.ros.result else digest()
        action_goal = digest(f"{HEADER} header", f"{GOAL_ID} goal_id", f"{goal} goal")
        action_result = digest(f"{HEADER} header", f"{STATUS} status", f"{result} result")
        action_feedback = digest(f"{HEADER} header", f"{STATUS} status", f"{digest()} feedback")
        action = digest(
            f"{action_goal} action_goal",
            f"{action_result} action_result",
            f"{action_feedback} action_feedback",
        )
        assert made[f"{name}Goal"] == [goal, *(line.split()[1] for line in skill.ros.goal)]
        assert made[f"{name}Result"][0] == result
        assert made[f"{name}ActionGoal"] == [action_goal, "header", "goal_id", "goal"]
        assert made[f"{name}ActionResult"] == [action_result, "header", "status", "result"]
        assert made[f"{name}ActionFeedback"] == [action_feedback, "header", "status", "feedback"]
        assert made[f"{name}Action"][0] == action


@pytest.mark.parametrize("path", sorted(p for p in WORKERS_FOLDER.glob("*.py") if "rosbridge" not in p.name))
def test_workers_are_read_by_python_3_8(path: Path) -> None:
    ast.parse(path.read_text(), feature_version=(3, 8))
