"""The virtual robot performs whole programs on a real ROS graph, and its command ends cleanly."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.trace import Status
from codebotler.core.world import Person, Room, World
from codebotler.missions.live import LiveRobot
from codebotler.models.recorded import open_recorded
from codebotler.robots.base import CancelledError, NotReadyError, Options, RobotLostError
from codebotler.robots.open import open_robot
from codebotler.robots.ros.virtual import VirtualRobot
from codebotler.robots.simulated import SIMULATION, Simulated
from codebotler.simulator.engine import run
from codebotler.simulator.worker import Worker
from roboeval.suites.load import Suite
from ros_graph import Graph, free_port, run_in_thread

WORLD = World((Room("hall"), Room("kitchen", ("mug",), (Person("ann", ("yes",)),))), "hall")
SPEED = 200.0  # The virtual robot's clock is faster: it drives at 100 m/s.


@pytest.fixture
def virtual(graph: Graph) -> Iterator[VirtualRobot]:
    virtual = VirtualRobot(WORLD, speed=None, address=graph.uri)
    assert not virtual.start()
    yield virtual
    virtual.stop()


@pytest.mark.usefixtures("virtual")
def test_it_acts_on_the_graph_like_the_simulated_robot(graph: Graph) -> None:
    robot = graph.robot(skills=SKILLS)
    robot.connect()
    assert robot.missing == {}
    assert robot.perform("get_all_rooms", []) == ["hall", "kitchen"]
    assert robot.perform("go_to", ["kitchen"]) is None
    assert robot.perform("get_current_location", []) == "kitchen"
    assert robot.perform("is_in_room", ["mug"]) is True
    assert robot.perform("ask", ["ann", "Tea, „ann”?", ("yes", "no")]) == "yes"
    assert robot.perform("pick", ["mug"]) is None
    with pytest.raises(RobotError) as error:
        robot.perform("pick", ["mug"])
    assert error.value.kind == "PickWhileHolding"
    assert str(error.value) == 'the robot holds "mug" and cannot pick up "mug" as well'


def test_it_stops_and_then_performs_the_next_skill(graph: Graph) -> None:
    virtual = VirtualRobot(WORLD, speed=1.0, address=graph.uri)
    virtual.start()
    robot = graph.robot(skills=SKILLS)
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["kitchen"])) as ended:
        while not virtual._current:
            time.sleep(0.01)
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)
    robot.connect()
    assert robot.perform("get_current_location", []) == "hall"
    virtual.stop()


def test_goals_wait_for_each_other_and_one_that_waits_can_be_cancelled(virtual: VirtualRobot) -> None:
    virtual._current = "another"
    virtual._cancel("waits")
    assert virtual._cancelled == {"waits"}
    assert virtual._body.clock.wait(0)
    virtual._cancel("another")
    assert not virtual._body.clock.wait(0)


def test_reference_programs_act_on_a_ros_graph_like_in_the_simulator(paper: Suite, graph: Graph) -> None:
    model = open_recorded("recorded:careful")
    tasks = [(task.name, task.prompts[0], task.scenarios[0].world) for task in [*paper.tasks.values()][::2]]
    programs = [model.solution(instruction, 0).program for _, instruction, _ in tasks]
    worlds = [world for _, _, world in tasks]
    simulated = list(run(zip(programs, worlds, strict=True), workers=1, settings=SIMULATION))
    assert len(tasks) == 8

    virtual = VirtualRobot(worlds[0], speed=SPEED, address=graph.uri)
    virtual.start()
    robot = graph.robot(skills=SKILLS, speed=SPEED)
    worker = Worker()
    try:
        for (name, _, world), program, expected in zip(tasks, programs, simulated, strict=True):
            virtual._body = Simulated(world, speed=SPEED)
            virtual._body.connect()
            robot.connect()
            live = LiveRobot(robot, lambda *_, **__: None, clock_starts=SIMULATION.clock_starts)
            outcome = worker.run_live(program, live)
            assert outcome.status == Status.FINISHED == expected.status, (name, outcome)
            assert outcome.trace == expected.trace, name
    finally:
        worker.close()
        virtual.stop()


def test_taken_port_and_distant_master_are_reported() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(NotReadyError, match=f"port {port} .*not a ROS master"):
            VirtualRobot(WORLD, address=f"http://localhost:{port}").start()


def test_master_elsewhere_is_never_started(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.2:{free_port()}")
    with pytest.raises(NotReadyError, match=r"no ROS master .*http://127\.0\.0\.2"):
        VirtualRobot(WORLD).start()


def test_second_virtual_robot_is_refused(graph: Graph, virtual: VirtualRobot) -> None:
    with pytest.raises(NotReadyError, match="node /virtual_robot at http"):
        VirtualRobot(WORLD, address=graph.uri).start()
    assert virtual._worker is not None
    assert virtual._worker.receive(0) is None


def test_killed_worker_is_reported(virtual: VirtualRobot) -> None:
    assert virtual._worker is not None
    os.kill(virtual._worker._process.pid, signal.SIGKILL)
    with pytest.raises(RobotLostError, match=r"virtual robot's worker has died \(signal 9\)"):
        virtual.wait()


def test_command_starts_a_master_that_ends_with_it(tmp_path: Path) -> None:
    world, port = tmp_path / "world.yaml", free_port()
    world.write_text(WORLD.to_yaml())
    command = [sys.executable, "-m", "codebotler", "virtual-robot", "--world", str(world)]
    process = subprocess.Popen(
        [*command, "--speed", "100"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={
            **os.environ,
            "PYTHONPATH": str(Path(__file__).parents[2] / "src"),
            "ROS_MASTER_URI": f"http://localhost:{port}",
        },
    )
    assert process.stderr is not None
    assert re.search(rf"ROS master .*http://localhost:{port}\b.*Ctrl-C", process.stderr.readline())
    robot = open_robot("ros1", Options(address=f"http://localhost:{port}"))
    robot.connect()
    robot.perform("go_to", ["kitchen"])
    with pytest.raises(RobotError):
        robot.perform("go_to", ["moon"])
    robot.disconnect()
    process.send_signal(signal.SIGINT)
    said, errors = process.communicate(timeout=60)
    *calls, failed = said.splitlines()
    assert calls == ["go_to(kitchen)", "  succeed None", "go_to(moon)"]
    assert re.match('  abort GoToInvalidLocation: .*"moon"', failed)
    assert (process.returncode, errors) == (130, "codebotler: stopped\n")
    with pytest.raises(NotReadyError, match="no ROS master"):
        robot.connect()
