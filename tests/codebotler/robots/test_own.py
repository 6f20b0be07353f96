"""A robot of one's own is a class; the three examples work with real servers."""

import json
import socket
import socketserver
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, TypeAlias

import pytest

from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.paper import SKILLS
from codebotler.missions.mission import Mission
from codebotler.robots import own
from codebotler.robots.base import CancelledError, NotReadyError, Options, Robot, RobotLostError
from codebotler.robots.open import SpellingRobot, open_robot
from codebotler.robots.reservation import Reservation

EXAMPLES = Path(__file__).parents[3] / "examples"
Write: TypeAlias = Callable[[str], Robot]
SOON = 20.0  # seconds


@pytest.fixture(name="write")
def write_(tmp_path: Path) -> Iterator[Write]:
    def write(body: str) -> Robot:
        path = tmp_path / f"lab_robot_{time.monotonic_ns()}.py"
        path.write_text(
            f"import asyncio, threading, time\nfrom codebotler import RobotError\nclass Spot:\n{body}"
        )
        robot = open_robot(f"{path}:Spot")
        opened.append(robot)
        return robot

    opened: list[Robot] = []
    yield write
    for robot in opened:
        robot.disconnect()


BASE = """
    stopped = 0
    def stop(self): self.stopped += 1
    def rooms(self): return ["hall", "lab"]
"""


def test_methods_are_skills_async_or_not_and_rooms_lists_the_rooms(write: Write) -> None:
    robot = write(
        BASE
        + """
    def get_current_location(self): return "hall"
    async def is_in_room(self, entity):
        await asyncio.sleep(0)
        return entity == "mug"
    def ask(self, person, question, options): return options[-1]
"""
    )
    robot.connect()
    assert robot.perform("get_all_rooms", ()) == ["hall", "lab"]
    assert robot.perform("is_in_room", ["mug"]) is True
    assert robot.perform("ask", ["ann", "Tea?", ("yes", "no")]) == "no"
    assert robot.missing == {
        skill: f"Spot has no method {skill}" for skill in ("go_to", "say", "pick", "place")
    }
    with pytest.raises(RobotError, match="Spot has no method say"):
        robot.perform("say", ["hello"])


@pytest.mark.parametrize(
    "go_to",
    [
        "async def go_to(self, location): await asyncio.sleep(600)",
        "def go_to(self, location): self.event.wait(600)",
    ],
)
def test_a_stop_ends_a_running_skill(write: Write, go_to: str) -> None:
    robot = write(
        f"""
    def __init__(self): self.event = threading.Event()
    def stop(self): self.event.set()
    def rooms(self): return ["hall"]
    {go_to}
"""
    )
    robot.connect()
    ended: list[BaseException] = []

    def drive() -> None:
        try:
            robot.perform("go_to", ["hall"])
        except CancelledError as error:
            ended.append(error)

    thread = threading.Thread(target=drive)
    thread.start()
    time.sleep(0.2)
    robot.cancel()
    thread.join(SOON)
    assert len(ended) == 1
    with pytest.raises(CancelledError):
        robot.perform("go_to", ["hall"])
    robot.connect()
    assert robot.perform("get_all_rooms", ()) == ["hall"]


def test_declared_errors_reach_the_program_and_others_end_the_mission(tmp_path: Path) -> None:
    (tmp_path / "skills.py").write_text(
        "from codebotler import Simulation, skill\n"
        '@skill(fails={"DoorLocked": "the door is locked"})\n'
        "def open_door(sim: Simulation, door: str) -> bool:\n"
        '    """Open."""\n'
    )
    (tmp_path / "lab.py").write_text(
        "class DoorLocked(Exception): pass\n"
        "class Spot:\n"
        f"    def stop(self): open({str(tmp_path / 'stopped')!r}, 'w').close()\n"
        "    def rooms(self): return ['hall']\n"
        "    def open_door(self, door):\n"
        "        if door == 'locked': raise DoorLocked\n"
        "        return door.no_such_method()\n"
    )
    robot = open_robot(f"{tmp_path / 'lab.py'}:Spot", Options(skills=skills_from(tmp_path / "skills.py")))
    robot.connect()
    with pytest.raises(RobotError, match="open_door: the door is locked") as caught:
        robot.perform("open_door", ["locked"])
    assert caught.value.kind == "DoorLocked"
    with pytest.raises(RobotLostError, match=r"Spot\.open_door failed: AttributeError.*lab\.py, line 7"):
        robot.perform("open_door", ["other"])
    assert (tmp_path / "stopped").exists()
    robot.disconnect()


def test_error_in_stop_loses_the_robot(write: Write) -> None:
    robot = write(
        """
    def stop(self): raise OSError("the line is dead")
    def rooms(self): return ["hall"]
    def say(self, message): time.sleep(0.5)
"""
    )
    robot.connect()
    errors: list[str] = []

    def speak() -> None:
        try:
            robot.perform("say", ["hello"])
        except RobotLostError as error:
            errors.append(str(error))

    thread = threading.Thread(target=speak)
    thread.start()
    time.sleep(0.1)
    robot.cancel()
    thread.join(SOON)
    (sentence,) = errors
    assert sentence.startswith("Spot.stop failed: OSError: the line is dead (lab_robot_")
    assert sentence.endswith(".py, line 5); STOP THE ROBOT BY HAND")


def test_another_press_stops_a_robot_that_missed_the_first_one(write: Write) -> None:
    robot = write(
        """
    is_connected, calls = False, 0
    def stop(self):
        self.calls += 1
        if self.calls == 1: raise OSError("the line is dead")
    def rooms(self): return ["hall"]
    def say(self, message): time.sleep(0.5)
    def get_current_location(self): return str(self.calls)
"""
    )
    robot.connect()
    with ThreadPoolExecutor() as threads:
        speech = threads.submit(robot.perform, "say", ["hello"])
        time.sleep(0.1)
        robot.cancel()
        robot.cancel()
        with pytest.raises(CancelledError):
            speech.result(SOON)
    robot.cancel()  # Only a person knows whether it has stopped, so each press is sent.
    robot.connect()
    assert robot.perform("get_current_location", ()) == "3"


def test_robot_whose_method_failed_is_stopped_at_each_press(write: Write) -> None:
    robot = write(
        """
    calls = 0
    def stop(self): self.calls += 1
    def rooms(self): return ["hall"]
    def say(self, message): raise ConnectionError("no route")
    def get_current_location(self): return str(self.calls)
"""
    )
    robot.connect()
    with pytest.raises(RobotLostError):
        robot.perform("say", ["hello"])
    robot.disconnect()
    robot.cancel()
    robot.cancel()
    robot.connect()
    assert robot.perform("get_current_location", ()) == "3"


def test_a_running_async_method_ends_before_stop_has_returned(write: Write) -> None:
    """Else the method would go on commanding the robot, which never stands still."""
    robot = write(
        """
    speed, brakes = 0.0, 0
    def rooms(self): return ["hall"]
    def stop(self):
        while self.speed: self.speed = 0.0; self.brakes += 1; time.sleep(0.03)
    async def go_to(self, location):
        while True: self.speed = 0.5; await asyncio.sleep(0.01)
"""
    )
    robot.connect()
    with ThreadPoolExecutor() as threads:
        drive = threads.submit(robot.perform, "go_to", ["hall"])
        time.sleep(0.05)
        robot.cancel()
        with pytest.raises(CancelledError):
            drive.result(SOON)
    assert robot._body.brakes < 10  # type: ignore[attr-defined]  # of a class in a file


def test_an_async_method_does_not_begin_after_a_stop(write: Write) -> None:
    robot = write(
        """
    began = False
    def rooms(self): return ["hall"]
    def stop(self): pass
    def go_to(self, location):
        self.before()
        return self.drive()
    async def drive(self): self.began = True
"""
    )
    robot.connect()
    body = robot._body  # type: ignore[attr-defined]  # of a class in a file
    body.before = robot.cancel
    with pytest.raises(CancelledError):
        robot.perform("go_to", ["hall"])
    assert not body.began


def test_stop_cancels_a_method_that_cleans_up_after_a_time_limit_of_its_own(write: Write) -> None:
    robot = write(
        """
    began, tries = threading.Event(), 0
    def rooms(self): return ["hall"]
    def stop(self): pass
    async def go_to(self, location):
        for _ in range(9):
            try:
                async with asyncio.timeout(0.01):
                    self.tries += 1
                    try: await asyncio.sleep(30)
                    finally: self.began.set(); await asyncio.sleep(0.1)
            except TimeoutError: pass
"""
    )
    robot.connect()
    body = robot._body  # type: ignore[attr-defined]  # of a class in a file
    with ThreadPoolExecutor() as threads:
        drive = threads.submit(robot.perform, "go_to", ["hall"])
        assert body.began.wait(SOON)
        robot.cancel()
        with pytest.raises(CancelledError):
            drive.result(SOON)
    assert body.tries == 1


@pytest.mark.parametrize("leaves", [False, True], ids=["stop", "disconnect"])
def test_a_cancelled_method_counts_as_running_until_it_has_cleaned_up(write: Write, *, leaves: bool) -> None:
    robot = write(
        """
    began, folded = threading.Event(), False
    def rooms(self): return ["hall"]
    def stop(self): pass
    async def go_to(self, location):
        try: self.began.set(); await asyncio.sleep(30)
        finally: await asyncio.sleep(0.05); self.folded = True
"""
    )
    robot.connect()
    body = robot._body  # type: ignore[attr-defined]  # of a class in a file
    with ThreadPoolExecutor() as threads:
        drive = threads.submit(robot.perform, "go_to", ["hall"])
        assert body.began.wait(SOON)
        (robot.disconnect if leaves else robot.cancel)()
        if not leaves:
            time.sleep(0.02)
            robot.cancel()  # another press does not end the clean-up
        with pytest.raises(CancelledError):
            drive.result(SOON)
        assert body.folded


def test_stop_that_blocks_is_not_awaited_for_long(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own, "STOP_SECONDS", 0.1)
    robot = write(
        """
    gate = threading.Event()
    def rooms(self): return ["hall"]
    def stop(self): self.gate.wait(30)
    def say(self, message): raise ConnectionError("no route")
"""
    )
    robot.connect()
    with pytest.raises(RobotLostError, match=r"no route.*took too long"):
        robot.perform("say", ["hello"])
    robot._body.gate.set()  # type: ignore[attr-defined]  # of a class in a file


def test_one_press_calls_stop_once(write: Write, tmp_path: Path) -> None:
    robot = write(
        BASE
        + """
    speaks = threading.Event()
    def get_current_location(self): return "hall"
    async def say(self, message): self.speaks.set(); await asyncio.sleep(30)
"""
    )
    mission = Mission(tmp_path, robot.name)
    mission.set_program("def task_program():\n    say('a')\n")
    mission.record_check([])
    mission.approve()
    with Reservation(robot, tmp_path) as reserved, mission, ThreadPoolExecutor() as threads:
        run = threads.submit(mission.run, reserved)
        assert robot._body.speaks.wait(SOON)  # type: ignore[attr-defined]  # of a class in a file
        time.sleep(0.05)
        mission.stop()
        run.result(SOON)
    assert robot._body.stopped == 1  # type: ignore[attr-defined]  # of a class in a file


def test_robot_does_not_connect_while_a_stop_is_under_way(write: Write) -> None:
    robot = write(
        """
    gate, called = threading.Event(), threading.Event()
    def stop(self): self.called.set(); self.gate.wait(30)
    def rooms(self): return ["hall"]
    def say(self, message): self.called.wait(30)
    def get_current_location(self): return "hall"
"""
    )
    robot.connect()
    with ThreadPoolExecutor() as threads:
        speech = threads.submit(robot.perform, "say", ["hello"])
        stop = threads.submit(robot.cancel)
        time.sleep(0.05)
        robot.disconnect()
        with pytest.raises(NotReadyError):
            robot.connect()
        robot._body.gate.set()  # type: ignore[attr-defined]  # of a class in a file
        stop.result(SOON)
        with pytest.raises(CancelledError):
            speech.result(SOON)
    robot.connect()
    assert robot.perform("get_current_location", ()) == "hall"


STOPS_BADLY = {
    "raises": "def stop(self): self.event.set(); raise RuntimeError('the brake failed')",
    "raises late": "def stop(self): self.event.set(); time.sleep(1); raise OSError('the brake failed')",
    "async": "async def stop(self): self.event.set(); raise RuntimeError('the brake failed')",
}


ASKS, SLEEPS = "say('hello')", "import time\n    say('a')\n    time.sleep(60)"
QUICK = {("raises", SLEEPS), ("async", ASKS)}


@pytest.mark.parametrize(
    ("stop", "program"),
    [
        pytest.param(stop, program, marks=[pytest.mark.slow] * ((stop, program) not in QUICK))
        for stop in STOPS_BADLY
        for program in (ASKS, SLEEPS)
    ],
)
def test_a_mission_of_a_robot_that_could_not_be_stopped_has_failed(
    write: Write, tmp_path: Path, stop: str, program: str
) -> None:
    robot = write(
        f"""
    def __init__(self): self.event, self.begun = threading.Event(), threading.Event()
    {STOPS_BADLY[stop]}
    def rooms(self): return ["hall"]
    def say(self, message):
        self.begun.set()
        if message == "hello": self.event.wait(60)
"""
    )
    assert isinstance(robot, SpellingRobot)
    with Reservation(robot, tmp_path) as reserved, Mission(tmp_path, robot.name) as mission:
        mission.set_program(f"def task_program():\n    {program}\n")
        mission.record_check([])
        mission.approve()

        def stop_soon() -> None:
            assert robot._body.begun.wait(60)
            time.sleep(0.2)
            mission.stop()

        threading.Thread(target=stop_soon).start()
        assert mission.run(reserved) == "failed"
        assert "the brake failed" in mission.summary.reason
        assert mission.summary.reason.endswith("STOP THE ROBOT BY HAND")


def test_a_robot_gets_members_of_enumerations_and_gives_them_back(tmp_path: Path) -> None:
    (tmp_path / "skills.py").write_text(
        "from enum import Enum\nfrom codebotler import Simulation, skill\n"
        "class Level(Enum):\n    LOW = 1\n    HIGH = 2\n"
        "@skill\ndef set_levels(sim: Simulation, levels: list[Level], to: float) -> Level:\n    'Set.'\n"
    )
    (tmp_path / "lab.py").write_text(
        "class Spot:\n"
        "    def stop(self): pass\n"
        "    def rooms(self): return ['hall']\n"
        "    def set_levels(self, levels, to):\n"
        "        assert isinstance(to, float)\n"
        "        return levels[1]\n"
    )
    robot = open_robot(f"{tmp_path / 'lab.py'}:Spot", Options(skills=skills_from(tmp_path / "skills.py")))
    robot.connect()
    assert robot.perform("set_levels", [(1, 2), 3]) == 2
    robot.disconnect()


def test_a_robot_that_does_not_connect_is_not_ready(write: Write) -> None:
    robot = write(BASE + "    def connect(self): raise ConnectionError('no route')\n")
    with pytest.raises(NotReadyError, match="Spot did not connect: ConnectionError: no route"):
        robot.connect()


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("", r"the file has no class Spot"),
        ("class Sport: pass\n", r"the file has no class Spot; its classes are Sport"),
        ("from pathlib import Path as Spot\n", r"the file has no class Spot"),
        (
            "class Spot:\n    stop = rooms = print\n    def say(self): pass\n",
            r"line 3: Spot\.say has the wrong parameters; write def say\(self, message\)",
        ),
        ("class Spot:\n    def rooms(self): pass\n", r"line 1: Spot has no method stop, which stops"),
        ("class Spot:\n    def stop(self): pass\n", r"Spot has no method rooms, which lists"),
        (
            "class Spot:\n    def __init__(self): 1 / 0\n    stop = rooms = print\n",
            r"Spot\(\) failed: ZeroDiv",
        ),
        ("1 / 0\n", r"line 1: the file cannot be run: ZeroDivisionError"),
    ],
)
def test_error_names_the_fault_of_a_class(tmp_path: Path, source: str, message: str) -> None:
    path = tmp_path / "lab_robot.py"
    path.write_text(source)
    with pytest.raises(UserError, match=message):
        open_robot(f"{path}:Spot")


# --- three robots with real servers


class Controller(socketserver.StreamRequestHandler):
    """The controller of an arm."""

    def handle(self) -> None:
        for line in self.rfile:
            name, *arguments = json.loads(line)
            answer: dict[str, object] = {"result": None}
            if name == "detect":
                answer = {"result": ["cup", "pen"]}
            elif name == "move" and arguments == ["pen", "drawer"]:
                answer = {"error": "the drawer is full"}
            CALLS.append([name, *arguments])
            self.wfile.write(json.dumps(answer).encode() + b"\n")


CALLS: list[Any] = []


def test_sdk_example_performs_skills_and_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    CALLS.clear()
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Controller) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        monkeypatch.setenv("ARM_ADDRESS", f"127.0.0.1:{server.server_address[1]}")
        skills = skills_from(EXAMPLES / "skills" / "tidy_arm" / "skills.py")
        robot = open_robot(f"{EXAMPLES / 'robots' / 'sdk_robot.py'}:Arm", Options(skills=skills))
        robot.connect()
        assert robot.perform("seen_on_table", ()) == ["cup", "pen"]
        robot.perform("tidy", ["cup", "bin"])
        with pytest.raises(RobotError, match="full") as caught:
            robot.perform("tidy", ["pen", "drawer"])
        assert caught.value.kind == "ReceptacleFull"
        robot.cancel()
        robot.disconnect()
        server.shutdown()
    assert CALLS == [["detect"], ["move", "cup", "bin"], ["move", "pen", "drawer"], ["halt"]]


class CartHandler(BaseHTTPRequestHandler):
    """The server of a cart; a drive to the attic lasts until the stop."""

    stop = threading.Event()

    def do_POST(self) -> None:
        values = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        path, status, answer = self.path.strip("/"), 200, json.dumps(None)
        match path, values:
            case "rooms", _:
                answer = json.dumps(["hall", "attic"])
            case "where", _:
                answer = json.dumps("hall")
            case "drive", {"to": "attic"}:
                self.stop.wait(SOON)
                status, answer = 500, "stopped"
            case "drive", {"to": "moon"}:
                status, answer = 409, "there is no moon"
            case "look", _:
                answer = json.dumps(values["what"] == "mug")
            case "stop", _:
                self.stop.set()
        self.send_response(status)
        self.end_headers()
        self.wfile.write(answer.encode())

    def log_message(self, *_: object) -> None:
        """Say nothing."""


def test_http_example_performs_skills_and_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    with ThreadingHTTPServer(("127.0.0.1", 0), CartHandler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        monkeypatch.setenv("CART_URL", f"http://127.0.0.1:{server.server_address[1]}")
        robot = open_robot(f"{EXAMPLES / 'robots' / 'http_robot.py'}:Cart", Options(skills=SKILLS))
        robot.connect()
        assert robot.perform("get_all_rooms", ()) == ["hall", "attic"]
        assert robot.perform("is_in_room", ["mug"]) is True
        with pytest.raises(RobotError, match="there is no moon"):
            robot.perform("go_to", ["moon"])
        threading.Timer(0.3, robot.cancel).start()
        with pytest.raises(CancelledError):
            robot.perform("go_to", ["attic"])
        robot.disconnect()
        server.shutdown()


MCP_SERVER = """
import sys
from mcp.server import MCPServer
from mcp.server.mcpserver.exceptions import ToolError

server = MCPServer("porter")
log = open(sys.argv[2], "a", buffering=1)


@server.tool()
def call_lift() -> bool:
    print("call_lift", file=log)
    return True


@server.tool()
def ride_to(floor: int) -> None:
    print("ride_to", floor, file=log)
    if floor > 5:
        raise ToolError("the house has five floors")


@server.tool()
def stop() -> None:
    print("stop", file=log)


server.run("streamable-http", host="127.0.0.1", port=int(sys.argv[1]))
"""


@pytest.mark.slow
def test_mcp_example_performs_skills_and_stops(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    (tmp_path / "server.py").write_text(MCP_SERVER)
    log = tmp_path / "log"
    started = [sys.executable, str(tmp_path / "server.py"), str(port), str(log)]
    with subprocess.Popen(started, stderr=subprocess.DEVNULL) as server:
        try:
            wait_for(port)
            monkeypatch.setenv("PORTER_URL", f"http://127.0.0.1:{port}/mcp")
            monkeypatch.setenv("PORTER_TOOLS", "call_lift,ride_to")
            skills = skills_from(EXAMPLES / "skills" / "hotel_lift" / "skills.py")
            robot = open_robot(f"{EXAMPLES / 'robots' / 'mcp_robot.py'}:Porter", Options(skills=skills))
            robot.connect()
            assert robot.perform("call_lift", ()) is True
            robot.perform("ride_to", [3])
            with pytest.raises(RobotError, match="five floors"):
                robot.perform("ride_to", [6])
            with pytest.raises(RobotError, match="nobody has approved of the tool knock"):
                robot.perform("knock", [305])
            robot.cancel()
            robot.disconnect()
        finally:
            server.terminate()
    assert log.read_text().split("\n")[:-1] == ["call_lift", "ride_to 3", "ride_to 6", "stop"]


def wait_for(port: int) -> None:
    """Wait until a server listens."""
    deadline = time.monotonic() + SOON
    while time.monotonic() < deadline:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
            return
        time.sleep(0.1)
    raise TimeoutError("the server does not listen")
