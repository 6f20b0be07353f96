"""`codebotler run` asks a robot about its rooms before it moves, and checks the answers."""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import rich.progress  # noqa: F401 - an interrupt during a later import would leave a file open

from codebotler.checking.check import check
from codebotler.cli.operating.run import Request, run
from codebotler.core.errors import RobotError, UserError
from codebotler.core.world import Room, World
from codebotler.missions.mission import Mission
from codebotler.missions.preflight import ask_rooms, limit_rooms, unknown_rooms
from codebotler.missions.storage.log import MissionState, read_events
from codebotler.missions.storage.store import read_missions
from codebotler.models.base import Reply, TextListener, Usage, ignore_text
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt
from codebotler.robots.base import CancelledError, NotReadyError, RobotResult
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import Rule
from codebotler.web.console import Console
from doubles import FakeRobot, fail_with


def replies(rooms: object, here: object = "") -> Callable[[str, str], RobotResult]:
    """Answer like a robot that knows these rooms and is in this place."""
    answers = {"get_all_rooms": rooms, "get_current_location": here}
    return lambda skill, _first: answers.get(skill)  # type: ignore[return-value]  # A robot may answer anything.


@pytest.mark.parametrize(
    ("rooms", "here", "named"),
    [
        ([1, None, {}], "hall", r"get_all_rooms .*\[1, None, {}\], .*list\[str\]"),
        ("hall", "hall", r"get_all_rooms .*'hall', .*list\[str\]"),
        (["hall"], ["hall"], r"get_current_location .*\['hall'\], .*str"),
        (["hall"], None, r"get_current_location .*None, .*str"),
    ],
)
def test_invalid_answer_is_reported_before_the_robot_moves(rooms: object, here: object, named: str) -> None:
    with pytest.raises(NotReadyError, match=named):
        ask_rooms(FakeRobot(replies(rooms, here)), print)


def test_robot_without_a_position_still_lists_its_rooms(capsys: pytest.CaptureFixture[str]) -> None:
    def answers(skill: str, _first: str) -> RobotResult:
        if skill == "get_current_location":
            raise RobotError("GetCurrentLocationFailed", "not localised")
        return ["hall", "lab"]

    plan, place = ask_rooms(FakeRobot(answers), print)
    assert plan is not None
    assert (plan.rooms, plan.start, place) == (("hall", "lab"), "hall", "")
    assert re.fullmatch(r"[^\n]*where it is\b[^\n]*: not localised\n", capsys.readouterr().out)


def test_robot_that_another_client_stops_is_not_ready() -> None:
    with pytest.raises(NotReadyError, match=r"rooms .*stopped"):
        ask_rooms(FakeRobot(fail_with(CancelledError())), print)


@pytest.mark.parametrize("fault", [None, ImportError("a library failed to import")])
def test_interrupt_that_a_library_swallows_still_counts(
    fault: Exception | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = FakeRobot(replies(["hall"], "hall"))

    def swallow() -> None:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
            time.sleep(0.2)  # The main thread handles the signal and stops this one.
        if fault is not None:
            raise fault

    monkeypatch.setattr(robot, "connect", swallow)
    monkeypatch.setattr(robot, "perform", fail_with(AssertionError("it was asked to do something")))
    (tmp_path / "go.py").write_text("def task_program():\n    say('hello')\n")
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        run_mission(robot, Request(str(tmp_path / "go.py"), yes=True), tmp_path, no_model)
    assert signal.getsignal(signal.SIGINT) is before


# --- rooms

LAB = "lab (2nd floor)"
TO_THE_LAB = f"""def task_program():
    for room in get_all_rooms():
        if room == {LAB!r}:
            go_to(room)
            say("there")
    if get_current_location() != {LAB!r}:
        raise ValueError("elsewhere")
    go_to("{LAB.upper()}")
"""


@dataclass
class WritingModel:
    """A model that writes one program and records its prompts."""

    program: str
    name: str = "writing"
    settings: SamplingSettings = field(default_factory=SamplingSettings)
    asked: list[Prompt] = field(default_factory=list)

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        self.asked.append(prompt)
        on_text(self.program)
        return Reply(self.program, self.program, Usage(1, 1), float(number), "stop")

    async def close(self) -> None: ...


def no_model(_name: str) -> WritingModel:
    raise AssertionError("there is a program")


def run_mission(
    robot: FakeRobot,
    request: Request,
    home: Path,
    open_model: Callable[[str], WritingModel],
    rules: tuple[Rule, ...] = (),
) -> int:
    return run(Console(robot, home, open_model, models=("writing",), rules=rules), request)


def test_check_uses_the_robots_own_room_names() -> None:
    plan, place = ask_rooms(FakeRobot(replies(["hall", LAB], LAB)), print)
    assert plan is not None
    assert (plan.rooms, plan.start, place) == (("hall", LAB), LAB, LAB)
    assert check(TO_THE_LAB, room_map=plan).problems == ()
    (unknown,) = unknown_rooms('def task_program():\n    go_to("lab (2nd flor)")\n', plan)
    assert '"lab (2nd flor)"' in unknown
    assert f'"{LAB}"' in unknown


@pytest.mark.parametrize(
    ("program", "status"), [(TO_THE_LAB, 0), ('def task_program():\n    go_to("cellar")\n', 1)]
)
def test_prompt_uses_the_robots_own_room_names(
    program: str, status: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = WritingModel(program)
    robot = FakeRobot(replies(["hall", LAB], LAB))
    assert run_mission(robot, Request("go to the lab", yes=True), tmp_path, lambda _: model) == status
    assert f"hall, {LAB}" in model.asked[0].text
    assert f"hall, {LAB}" in model.asked[0].messages[-1].text
    assert ('"cellar"' in capsys.readouterr().out) is bool(status)


def test_a_model_is_offered_no_skill_that_the_robot_lacks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = WritingModel('def task_program():\n    go_to("hall")\n    pick("mug")\n')
    robot = FakeRobot(replies(["hall"], "hall"))
    robot.missing = {"pick": "no server listens"}
    assert run_mission(robot, Request("bring the mug", yes=True), tmp_path, lambda _: model) == 1
    asked = "\n".join(message.text for message in model.asked[0].messages)
    assert "def place(" in asked
    assert "pick(" not in asked
    assert "line 3: this robot has no `pick` skill: no server listens" in capsys.readouterr().err


@pytest.mark.parametrize("any_room", [False, True])
def test_a_rule_with_a_misspelt_room_prevents_the_mission(tmp_path: Path, *, any_room: bool) -> None:
    (tmp_path / "go.py").write_text("def task_program():\n    say('hello')\n")
    bob = Rule("bob", "Leave Bob alone.", parse('not tr.Exists(goto("bobs office"))'), any_room=any_room)
    request = Request(str(tmp_path / "go.py"), yes=True)
    robot = FakeRobot(replies(["hall", "bob's office"], "hall"))
    if any_room:
        assert run_mission(robot, request, tmp_path, no_model, (bob,)) == 0
    else:
        with pytest.raises(UserError, match=r"bobs office.*bob's office"):
            run_mission(robot, request, tmp_path, no_model, (bob,))
        (mission,) = read_missions(tmp_path)
        assert (mission.state, robot.connections) == (MissionState.FAILED, 0)
        assert robot.done == ["get_all_rooms", "get_current_location"], "it has not moved"


def test_rooms_of_the_simulated_robot_are_regexes_as_in_its_world() -> None:
    robot = Simulated(World((Room("hall"), Room("kitchen|cafe")), "hall"), speed=None)
    robot.connect()
    plan, _ = ask_rooms(robot, print)
    assert plan is not None
    assert plan.room("the cafe") == "kitchen|cafe"


def test_robot_is_where_it_says_even_if_it_does_not_list_that_room(
    capsys: pytest.CaptureFixture[str],
) -> None:
    plan, place = ask_rooms(FakeRobot(replies(["hall", "lab"], "dock")), print)
    assert plan is not None
    assert (plan.rooms, plan.start, place) == (("hall", "lab", "dock"), "dock", "dock")
    assert '"dock"' in capsys.readouterr().out
    starts_there = 'def task_program():\n    if get_current_location() != "dock":\n        raise ValueError\n'
    assert check(starts_there, room_map=plan).problems == ()


def test_warnings_about_a_robot_are_printed_and_logged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "go.py").write_text("def task_program():\n    say('hello')\n")
    robot = FakeRobot(replies(["hall", "lab"], "dock"))
    assert run_mission(robot, Request(str(tmp_path / "go.py"), yes=True), tmp_path, no_model) == 0
    assert '"dock"' in capsys.readouterr().err
    (mission,) = read_missions(tmp_path)
    assert any('"dock"' in line.get("text", "") for line in read_events(tmp_path / "missions" / mission.id))


def test_robot_without_a_position_has_no_place() -> None:
    plan, place = ask_rooms(FakeRobot(replies(["hall", "lab"])), print)
    assert plan is not None
    assert (plan.start, place) == ("hall", "")


def test_more_rooms_than_a_check_takes_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    rooms = [f"room {number} (of many)" for number in range(100_000)]
    began = time.monotonic()
    plan, place = ask_rooms(FakeRobot(replies(rooms, rooms[7])), print)
    assert place == rooms[7]
    assert limit_rooms(plan, print) is None
    assert time.monotonic() - began < 2, "each room is read only once"
    assert re.search(r"\b100,000 rooms\b.*\b1,000\b", capsys.readouterr().out)
    plan, _ = ask_rooms(FakeRobot(replies(rooms[:1_000], rooms[7])), print)
    assert plan is not None
    assert limit_rooms(plan, print) is plan


def test_place_of_a_mission_is_the_robots_own_room_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    places: list[str] = []

    def run(mission: Mission, reserved: Reservation, place: str = "", **rules: Any) -> MissionState:  # noqa: ANN401 - passed on
        places.append(place)
        return real(mission, reserved, place, **rules)

    real = Mission.run
    monkeypatch.setattr(Mission, "run", run)
    program = tmp_path / "say.py"
    program.write_text("def task_program():\n    say('hello')\n")
    request = Request(str(program), yes=True)
    assert run_mission(FakeRobot(replies(["hall", LAB], LAB)), request, tmp_path / "home", no_model) == 0
    assert places == [LAB]


def test_a_robot_drives_to_the_places_of_the_world_in_the_rooms_that_it_lists() -> None:
    world = World(
        (Room("hall"), Room("kitchen"), Room("sink", within="kitchen"), Room("bed", within="bedroom")), "hall"
    )
    room_map, _ = ask_rooms(FakeRobot(replies(["hall", "kitchen"], "hall")), print, world)
    assert room_map is not None
    assert room_map.goals == ("hall", "kitchen", "sink")
    assert room_map.possible_rooms("sink") == ["sink"]
