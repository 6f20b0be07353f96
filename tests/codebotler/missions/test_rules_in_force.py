"""A mission sends the robot no call that a house rule forbids, and stops instead."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.files import skills_from
from codebotler.core.world import Room, World
from codebotler.missions.display.view import MissionOrder
from codebotler.missions.display.wording import event_text
from codebotler.missions.mission import Mission, MissionError
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.log import EVENTS_FILE, LogLine, MissionState
from codebotler.models.base import Model, ModelError
from codebotler.models.recorded import open_recorded as recorded
from codebotler.robots.base import Robot, RobotResult
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import UNKNOWN_ROOM, Rule
from codebotler.simulator.worlds.room_map import RoomMap
from doubles import FakeRobot

VAULT = Rule("vault", "Never go into the vault.", parse('not tr.Exists(goto("vault"))'))
REPORT = Rule("report", "Say that it is done.", parse('tr.Exists(say("done"))'), "finally")
ROOMS = RoomMap(("hall", "kitchen", "the vault"), "hall", plain=True)
STUBBORN = """
def task_program():
    go_to("kitchen")
    while True:
        try:
            go_to("vault")
        except BaseException:
            pass
        finally:
            say("I go on")
"""


def robot_with(answer: Callable[[str, str], RobotResult] = lambda *_: None) -> FakeRobot:
    return FakeRobot(answer)


def robot_in(*rooms: str) -> FakeRobot:
    """Make a robot that knows these rooms and is in the first."""
    answers: dict[str, RobotResult] = {"get_all_rooms": [*rooms], "get_current_location": rooms[0]}
    return robot_with(lambda skill, _: answers.get(skill))


def run(
    folder: Path,
    robot: Robot,
    program: str,
    rules: Sequence[Rule],
    rooms: RoomMap = ROOMS,
    *,
    place: str = "hall",
) -> tuple[Mission, list[LogLine]]:
    mission = Mission(folder, robot.name)
    mission.set_program(program)
    mission.record_check([])
    mission.approve()
    with Reservation(robot, folder) as reserved, mission:
        mission.run(reserved, place, rules=rules, room_map=rooms)
    lines = (mission.folder / EVENTS_FILE).read_text().splitlines()
    return mission, [json.loads(line) for line in lines]


def test_forbidden_call_does_not_reach_the_robot_and_stops_the_mission(tmp_path: Path) -> None:
    robot = robot_with()
    mission, lines = run(tmp_path, robot, STUBBORN, [VAULT])
    assert (mission.state, mission.summary.reason) == (MissionState.STOPPED, "stopped by rule vault")
    assert robot.done == ["kitchen"]
    assert robot.cancels
    (violation,) = [line for line in lines if line["event"] == "rule"]
    assert violation["rule"] == "vault"
    assert violation["says"] == VAULT.says
    assert violation["formula"] == str(VAULT.formula)
    assert (violation["what"], violation["prevented"], violation["line"]) == (["goto", "vault"], True, 6)
    assert mission.summary.line == 6


def test_the_robot_is_stopped_before_anything_is_logged(tmp_path: Path) -> None:
    seen: list[str] = []

    class Noting(FakeRobot):
        def cancel(self) -> None:
            super().cancel()
            seen.append("cancel")

    robot = Noting()
    mission = Mission(tmp_path, robot.name, on_event=lambda line: seen.append(line["event"]))
    mission.set_program(STUBBORN)
    mission.record_check([])
    mission.approve()
    with Reservation(robot, tmp_path) as reserved, mission:
        mission.run(reserved, rules=[VAULT])
    assert seen.index("cancel") < seen.index("rule")
    assert seen.index("cancel") < seen.index("stop")


def test_a_refusal_is_logged_and_the_program_may_go_on(tmp_path: Path) -> None:
    refusing = Rule("vault", VAULT.says, VAULT.formula, refuse=True)
    program = (
        "def task_program():\n    try: go_to('vault')\n    except Exception as e: say(type(e).__name__)\n"
        "    go_to('kitchen')\n"
    )
    robot = robot_with()
    mission, lines = run(tmp_path, robot, program, [refusing])
    assert mission.state is MissionState.DONE
    assert robot.done == ["RuleViolation", "kitchen"]
    assert [line["prevented"] for line in lines if line["event"] == "rule"] == [True]


def test_answer_that_breaks_a_rule_stops_the_mission(tmp_path: Path) -> None:
    rule = Rule("stay", "Stop where nobody is.", parse('not tr.Exists(missed("person"))'))
    robot = robot_with(lambda skill, _: False if skill == "is_in_room" else None)
    program = "def task_program():\n    is_in_room('person')\n    say('hello?')\n"
    mission, lines = run(tmp_path, robot, program, [rule])
    assert mission.state is MissionState.STOPPED
    assert robot.done == ["person"]
    assert [line["prevented"] for line in lines if line["event"] == "rule"] == [False]


@pytest.mark.parametrize("said", ["done", "bye"])
def test_a_rule_of_the_end_is_reported_and_changes_nothing(tmp_path: Path, said: str) -> None:
    program = f"def task_program():\n    say('{said}')\n"
    mission, lines = run(tmp_path, robot_with(), program, [REPORT])
    assert mission.state is MissionState.DONE
    unkept = 'the rule "report" is not kept at the end: Say that it is done'
    assert mission.summary.reason == ("" if said == "done" else unkept)
    assert [line["rule"] for line in lines if line["event"] == "rule"] == ["report"] * (said != "done")


@pytest.mark.slow
@pytest.mark.parametrize("request_", ["vault", "THE VAULT", "not the vault"])
def test_the_room_that_a_request_means_counts(tmp_path: Path, request_: str) -> None:
    robot = robot_with()
    rule = Rule("vault", VAULT.says, parse('not tr.Exists(goto("^the vault$"))'))
    rooms = [rule] if "the vault" in request_.lower() else [VAULT]
    mission, _ = run(tmp_path, robot, f"def task_program():\n    go_to({request_!r})\n", rooms)
    assert mission.state is MissionState.STOPPED
    assert robot.done == []


def test_exact_room_name_means_that_room_only(tmp_path: Path) -> None:
    """The name of one of the two rooms contains the other's."""
    rooms = RoomMap(("hall", "room 1", "room 10"), "hall", plain=True)
    silent = Rule("ten", "Say nothing in room 10.", parse('not tr.Exists(at("room 10", say(".*")))'))
    program = "def task_program():\n    go_to('{}')\n    say('hello')\n"
    for room, state in (("room 10", MissionState.STOPPED), ("room 1", MissionState.DONE)):
        mission, _ = run(tmp_path / room[-2:], robot_with(), program.format(room), [silent], rooms)
        assert mission.state is state, room


IN_LAB_2 = Rule("quiet", "Say nothing in lab 2.", parse('not tr.Exists(at("lab 2", say(".*")))'))
LABS = RoomMap(("hall", "lab", "lab 2"), "hall", plain=True)


def require_room(room: str | None) -> str:
    if room is None:
        raise RobotError("NoLocation", "the map is not loaded")
    return room


@pytest.mark.slow
@pytest.mark.parametrize(
    ("where", "state"),
    [(None, MissionState.STOPPED), ("lab", MissionState.DONE), ("lab 2", MissionState.STOPPED)],
)
def test_robot_reports_its_room_after_a_drive_to_an_unlisted_one(
    tmp_path: Path, where: str | None, state: MissionState
) -> None:
    robot = robot_with(lambda skill, _: require_room(where) if skill == "get_current_location" else None)
    program = "def task_program():\n    go_to('where the computers are')\n    say('hello')\n"
    mission, _ = run(tmp_path, robot, program, [IN_LAB_2], LABS)
    assert mission.state is state


AFTER_LAB = Rule(
    "after", "Be silent after lab 2.", parse('not tr.OnlyAfterFirst(goto("^lab 2$")).Exists(say("."))')
)
THREE = "def task_program():\n    go_to('where the computers are')\n    say('one')\n    say('two')\n"


@pytest.mark.parametrize(
    ("rule", "asked"),
    [
        (IN_LAB_2, 1),
        (AFTER_LAB, 0),
        (VAULT, 0),
        (Rule("drives", "Drive little.", parse('not tr.AtLeast(goto("lab"), 3)')), 0),
    ],
    ids=["room", "goal", "other", "count"],
)
def test_robot_is_asked_once_and_only_if_a_rule_depends_on_it(tmp_path: Path, rule: Rule, asked: int) -> None:
    calls: list[str] = []

    def answer(skill: str, _: str) -> RobotResult:
        calls.append(skill)
        return "lab" if skill == "get_current_location" else None

    mission, _ = run(tmp_path, robot_with(answer), THREE, [rule], LABS)
    assert mission.state is MissionState.DONE
    assert calls.count("get_current_location") == asked


@pytest.mark.parametrize("refuse", [False, True])
def test_mission_stops_and_says_why_if_the_room_is_unknown(tmp_path: Path, *, refuse: bool) -> None:
    calls: list[str] = []

    def answer(skill: str, _: str) -> RobotResult:
        calls.append(skill)
        return require_room(None) if skill == "get_current_location" else None

    robot = robot_with(answer)
    rule = Rule("quiet", IN_LAB_2.says, IN_LAB_2.formula, refuse=refuse)
    mission, lines = run(tmp_path, robot, THREE.replace("say('one')", CAUGHT), [rule], LABS)
    assert mission.state is MissionState.STOPPED
    assert calls == ["go_to", "get_current_location"]
    assert robot.cancels
    (line,) = [line for line in lines if line["event"] == "rule"]
    assert (line["rule"], line["what"], line["prevented"], line["why"]) == (
        "quiet",
        ["say", "one"],
        True,
        UNKNOWN_ROOM,
    )
    assert line["why"] in event_text(line)


CAUGHT = "try: say('one')\n    except BaseException: pass"


def test_failed_drive_to_one_room_needs_no_question(tmp_path: Path) -> None:
    def answer(skill: str, _: str) -> RobotResult:
        raise RobotError("GoToInvalidLocation", f"{skill}: the door is shut")

    program = "def task_program():\n    try: go_to('lab')\n    except Exception: pass\n"
    mission, _ = run(tmp_path, robot_with(answer), program, [AFTER_LAB], LABS)
    assert mission.state is MissionState.DONE


def test_room_at_the_start_is_asked_for_if_a_rule_depends_on_it(tmp_path: Path) -> None:
    program = "def task_program():\n    say('hello')\n"
    for where, state in (
        (None, MissionState.STOPPED),
        ("lab 2", MissionState.STOPPED),
        ("lab", MissionState.DONE),
    ):
        robot = robot_with(lambda skill, _: require_room(where) if skill == "get_current_location" else None)  # noqa: B023 - called in this round
        mission, _ = run(tmp_path / str(where), robot, program, [IN_LAB_2], LABS, place="")
        assert mission.state is state, where


def test_rule_of_the_end_is_not_kept_if_the_room_is_unknown(tmp_path: Path) -> None:
    end = Rule("end", "Speak in the hall.", parse('not tr.Exists(at("lab", say(".*")))'), "finally")
    calls: list[str] = []

    def answer(skill: str, _: str) -> RobotResult:
        calls.append(skill)
        return require_room(None) if skill == "get_current_location" else None

    mission, lines = run(tmp_path, robot_with(answer), THREE, [end], LABS)
    assert mission.state is MissionState.DONE
    assert calls.count("get_current_location") == 1
    assert [line["rule"] for line in lines if line["event"] == "rule"] == ["end"]


def test_robot_that_lists_no_rooms_is_judged_by_the_words_of_drives(tmp_path: Path) -> None:
    for room, state in (("lab 2", MissionState.STOPPED), ("lab", MissionState.DONE)):
        mission = Mission(tmp_path / room, "robot")
        mission.set_program(f"def task_program():\n    go_to('{room}')\n    say('hello')\n")
        mission.record_check([])
        mission.approve()
        robot = robot_with()
        with Reservation(robot, tmp_path / room) as reserved, mission:
            mission.run(reserved, "", rules=[IN_LAB_2])
        assert mission.state is state, room


@pytest.mark.slow
def test_room_that_the_robot_reports_counts_even_if_not_requested(tmp_path: Path) -> None:
    for request_, where in (("by the stairs", "Lab 2 "), ("where the computers are", "lab 2")):
        robot = robot_with(lambda skill, _: where if skill == "get_current_location" else None)  # noqa: B023 - called in this round
        program = f"def task_program():\n    go_to({request_!r})\n    say('hello')\n"
        mission, _ = run(tmp_path / where.strip(), robot, program, [IN_LAB_2], LABS)
        assert mission.state is MissionState.STOPPED, request_


def test_failed_drive_counts_in_its_starting_room(tmp_path: Path) -> None:
    def answer(skill: str, _: str) -> RobotResult:
        raise RobotError("GoToInvalidLocation", f"{skill}: the door is shut")

    back = Rule("back", "Stay in lab 2.", parse('not tr.Exists(at("lab 2", goto(".*")))'))
    program = "def task_program():\n    try: go_to('lab 2')\n    except Exception: pass\n"
    for again, state in (("", MissionState.DONE), ("    go_to('hall')\n", MissionState.STOPPED)):
        mission, _ = run(tmp_path / state, robot_with(answer), program + again, [back], LABS)
        assert mission.state is state


SEARCH = """
from codebotler import Simulation, skill

@skill(fails={"NotFound": "it is not there"})
def search_for(sim: Simulation, what: str) -> None:
    "Search for a thing."
"""


def test_a_failed_attempt_of_an_own_skill_counts(tmp_path: Path) -> None:
    def answer(skill: str, _: str) -> RobotResult:
        if skill == "search_for":
            raise RobotError("NotFound", "it is not there")
        return None

    (tmp_path / "search.py").write_text(SEARCH)
    robot = robot_with(answer)
    robot.skills = skills_from(tmp_path / "search.py")
    formula = 'not tr.OnlyAfterFirst(search_for("floor")).Exists(say("."))'
    quiet = Rule("quiet", "Be silent after a search.", parse(formula, skills=robot.skills))
    program = "def task_program():\n    try: search_for('floor')\n    except Exception: say('hello')\n"
    mission, _ = run(tmp_path, robot, program, [quiet])
    assert mission.state is MissionState.STOPPED


SWITCHES = """
from codebotler import Simulation, skill

@skill(sets="on")
def turn_on(sim: Simulation, device: str) -> None:
    "Turn on a device."

@skill(clears="on")
def turn_off(sim: Simulation, device: str) -> None:
    "Turn off a device."

@skill(names="room")
def glide_to(sim: Simulation, room: str) -> None:
    "Glide to a room."
"""


@pytest.mark.parametrize(
    ("lines", "stopped", "unkept"),
    [
        (["turn_on('stove')", "go_to('kitchen')"], True, False),
        (["go_to('kitchen')", "turn_on('stove')", "go_to('kitchen')"], False, True),
        pytest.param(["turn_on('stove')", "glide_to('kitchen')"], True, False, marks=pytest.mark.slow),
        pytest.param(
            ["turn_on('stove')", "turn_off('stove')", "go_to('kitchen')"],
            False,
            False,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_leaving_rule_is_enforced_before_drives_and_reported_at_the_end(
    tmp_path: Path, lines: list[str], *, stopped: bool, unkept: bool
) -> None:
    (tmp_path / "switches.py").write_text(SWITCHES)
    where = "kitchen" if lines[0] == "go_to('kitchen')" else "hall"
    robot = robot_with(lambda skill, _: where if skill == "get_current_location" else None)
    robot.skills = skills_from(tmp_path / "switches.py")
    off = Rule("off", "Turn off the stove.", parse('not on("stove")', skills=robot.skills), "leaving")
    program = "def task_program():\n" + "".join(f"    {line}\n" for line in lines)
    mission, log = run(tmp_path, robot, program, [off])
    assert mission.state is (MissionState.STOPPED if stopped else MissionState.DONE)
    assert [line["event"] for line in log].count("skill") == len(lines) - stopped
    assert [line.get("prevented") for line in log if line["event"] == "rule"] == (
        [True] if stopped else [None] * unkept
    )


OWN = """
from codebotler import Simulation, skill

@skill(verb="glide to {room}", names="room")
def glide_to(sim: Simulation, room: str) -> None:
    "Glide to a room."
    sim.drive(room)

@skill(verb="wander", event=None)
def wander(sim: Simulation) -> None:
    "Go through all rooms."
    for room in sim.rooms:
        sim.drive(room)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "formula", "done"),
    [
        ("glide_to('the lab 2')", 'not tr.Exists(glide_to("^lab 2$"))', 0),
        ("glide_to('the lab 2')", 'not tr.Exists(at("lab 2", say(".*")))', 1),
        ("glide_to('lab 2')", 'not tr.Exists(at("hall", say(".*")))', 2),
        ("wander()", 'not tr.Exists(at("lab 2", say(".*")))', 1),
        ("wander()", 'not tr.Exists(at("hall", say(".*")))', 2),
    ],
)
def test_rules_follow_a_robot_that_own_skills_move(
    tmp_path: Path, call: str, formula: str, done: int
) -> None:
    (tmp_path / "own.py").write_text(OWN)
    skills = skills_from(tmp_path / "own.py")
    robot = Simulated(World((Room("hall"), Room("lab 2")), "hall"), speed=None, skills=skills)
    rule = Rule("own", "So it is.", parse(formula, skills=skills))
    rooms = RoomMap(("hall", "lab 2"), "hall")
    program = f"def task_program():\n    {call}\n    say('hello')\n"
    mission, lines = run(tmp_path, robot, program, [rule], rooms)
    assert [line["event"] for line in lines].count("skill") == done
    assert mission.state is (MissionState.DONE if done == 2 else MissionState.STOPPED)


@pytest.mark.parametrize(("where", "state"), [(None, MissionState.STOPPED), ("hall", MissionState.DONE)])
def test_failed_drive_may_end_anywhere_unless_the_robot_reports_its_room(
    tmp_path: Path, where: str | None, state: MissionState
) -> None:
    def answer(skill: str, _: str) -> RobotResult:
        if skill == "go_to":
            raise RobotError("GoToInvalidLocation", "the door is shut")
        return require_room(where) if skill == "get_current_location" else None

    program = "def task_program():\n    try: go_to('lab 2')\n    except Exception: say('hello')\n"
    mission, _ = run(tmp_path, robot_with(answer), program, [IN_LAB_2], LABS)
    assert mission.state is state


def test_start_room_is_matched_exactly(tmp_path: Path) -> None:
    """The first room of the list has a name that is part of the start's name."""
    rooms = RoomMap(("office", "bob's office"), "bob's office")
    rule = Rule("bob", "Say nothing at Bob's.", parse('not tr.Exists(at("bob\'s office", say(".*")))'))
    program = "def task_program():\n    say('hello')\n"
    mission, _ = run(tmp_path, robot_with(), program, [rule], rooms, place="bob's office")
    assert mission.state is MissionState.STOPPED


def test_carried_things_count_on_the_simulated_robot(tmp_path: Path) -> None:
    world = World((Room("hall", ("glass",)), Room("kitchen")), "hall")
    rule = Rule("glass", "No glass leaves the hall.", parse('not tr.Exists(holding("glass", goto(".*")))'))
    program = "def task_program():\n    go_to('hall')\n    pick('glass')\n    go_to('kitchen')\n"
    mission, lines = run(tmp_path, Simulated(world, speed=None), program, [rule])
    assert mission.state is MissionState.STOPPED
    assert [line["arguments"] for line in lines if line["event"] == "skill"][-1] == {"obj": "glass"}


REGEXES = RoomMap(("hall", "acme inc.", "lab [0-9]"), "hall")


@pytest.mark.parametrize("request_", ["acme inc ", " acme inc", "acme inc\t"])
def test_robot_receives_the_words_that_were_judged(tmp_path: Path, request_: str) -> None:
    """The room's regex needs one more character, which could be the trailing space."""
    robot = robot_in("hall")
    rule = Rule("acme", "Stay out.", parse('not tr.Exists(goto("acme inc[.]"))'))
    mission, _ = run(tmp_path, robot, f"def task_program():\n    go_to({request_!r})\n", [rule], REGEXES)
    assert mission.state is MissionState.DONE
    assert robot.done[0] == "acme inc"


@pytest.mark.parametrize(
    ("request_", "received"),
    [
        ("the stairs behind the kitchen", "kitchen"),
        ("Kitchen", "kitchen"),
        ("the kitchen 2, at the window", "kitchen 2"),
        (" cellar ", "cellar"),
    ],
)
def test_a_robot_with_its_own_planner_is_sent_the_listed_room(
    tmp_path: Path, request_: str, received: str
) -> None:
    rooms, robot = RoomMap(("hall", "kitchen", "kitchen 2"), "hall", plain=True), robot_in("hall")
    rule = Rule("acme", "Stay out.", parse('not tr.Exists(goto("acme"))'))
    run(tmp_path, robot, f"def task_program():\n    go_to({request_!r})\n", [rule], rooms)
    assert robot.done[0] == received


def test_a_rule_also_covers_the_programs_words_for_a_room(tmp_path: Path) -> None:
    rooms, robot = RoomMap(("hall", "lab  1"), "hall", plain=True), robot_in("hall")
    rule = Rule("lab", "Stay out.", parse('not tr.Exists(goto("lab 1"))'))
    mission, _ = run(tmp_path, robot, "def task_program():\n    go_to('lab 1')\n", [rule], rooms)
    assert mission.state is MissionState.STOPPED
    assert not {"lab 1", "lab  1"} & {*robot.done}


@pytest.mark.slow
@pytest.mark.parametrize(
    "formula",
    [
        'not tr.Exists(at("lab 3", pick(".*")))',
        'not tr.Exists(at("^lab 3$", pick(".*")))',
        'not tr.OnlyAfterLast(goto("^lab 3$")).Exists(pick(".*"))',
    ],
)
def test_a_room_whose_name_is_a_regex_counts_by_the_words_of_the_request_too(
    tmp_path: Path, formula: str
) -> None:
    rule = Rule("lab", "Take nothing in lab 3.", parse(formula))
    program = "def task_program():\n    go_to('lab {}')\n    pick('knife')\n"
    for number, state in ((3, MissionState.STOPPED), (4, MissionState.DONE)):
        mission, _ = run(tmp_path / str(number), robot_with(), program.format(number), [rule], REGEXES)
        assert mission.state is state


def test_an_answer_is_judged_as_the_option_that_it_means(tmp_path: Path) -> None:
    rule = Rule("no", "Stop at a no.", parse('not tr.Exists(answered("^no$"))'))
    robot = robot_with(lambda skill, _: "\tNo\n" if skill == "ask" else None)
    program = "def task_program():\n    say(ask('ann', 'Tea?', ['yes', 'no']))\n"
    mission, _ = run(tmp_path, robot, program, [rule])
    assert mission.state is MissionState.STOPPED
    assert robot.done == ["ann"]


@pytest.mark.slow
def test_rules_hold_in_a_building_of_more_rooms_than_a_check_takes(tmp_path: Path) -> None:
    rooms = RoomMap(("hall", *(f"room {number}" for number in range(1_500)), "vault"), "hall", plain=True)
    rule = Rule("vault", VAULT.says, parse('not tr.Exists(goto("^vault$"))'))
    robot = robot_in(*rooms.rooms)
    program = "def task_program():\n    go_to('into the vault')\n"
    session = MissionSession(
        robot,
        tmp_path,
        MissionOrder(program=program),
        open_model=recorded,
        rules=(rule,),
    )
    session.start()
    view = session.wait_until(lambda now: now.may_be_approved)
    assert any("1,502 rooms" in remark for remark in view.remarks)
    session.approve(view.digest, despite_problems=True)
    assert session.wait_until(lambda _: False).state is MissionState.STOPPED
    assert "into the vault" not in robot.done


def test_a_rule_that_was_switched_off_is_in_force_for_another_program(tmp_path: Path) -> None:
    session = MissionSession(
        robot_in("hall", "vault"),
        tmp_path,
        MissionOrder(program=STUBBORN),
        open_model=recorded,
        rules=(VAULT,),
    )
    session.start()
    session.wait_until(lambda now: now.may_be_approved)
    for reason in ("", " ", "\u200b", "..."):
        with pytest.raises(MissionError, match="give a reason"):
            session.switch_off("vault", reason)
    session.switch_off("vault", "the door is broken")
    assert session.wait_until(lambda now: now.may_be_approved).rules_in_force == ()
    with pytest.raises(MissionError, match="switched-off rules"):  # This approval saw it in force.
        session.approve(session.view.digest, despite_problems=True, disabled_rules=())
    session.edit("def task_program():\n    go_to('vault')\n")
    assert session.wait_until(lambda now: now.may_be_approved).rules_in_force == (VAULT,)
    session.stop("a test")
    session.join(10)


def test_a_rule_stays_switched_off_if_no_other_program_comes(tmp_path: Path) -> None:
    def refuses(_name: str) -> Model:
        raise ModelError("the model is not there", is_temporary=False)

    order = MissionOrder("Go to the vault.", "refuses", STUBBORN)
    session = MissionSession(robot_in("hall", "vault"), tmp_path, order, open_model=refuses, rules=(VAULT,))
    session.start()
    session.wait_until(lambda now: now.may_be_approved)
    session.switch_off("vault", "the door is broken")
    checked = session.wait_until(lambda now: now.may_be_asked_again)
    session.ask_again(repair=False)
    view = session.wait_until(lambda now: bool(now.error))
    assert (view.check, view.disabled_rules) == (checked.check, ("vault",))
    session.stop("a test")
    session.join(10)


def test_a_rule_that_was_switched_off_is_in_force_for_a_models_next_program(tmp_path: Path) -> None:
    order = MissionOrder(next(iter(recorded("recorded").replies)), "recorded")
    session = MissionSession(robot_in("hall", "vault"), tmp_path, order, open_model=recorded, rules=(VAULT,))
    session.start()
    session.wait_until(lambda now: now.may_be_approved)
    session.switch_off("vault", "the door is broken")
    session.wait_until(lambda now: now.may_be_asked_again)
    session.ask_again(repair=False)
    assert session.wait_until(lambda now: now.may_be_approved).rules_in_force == (VAULT,)
    session.stop("a test")
    session.join(10)
