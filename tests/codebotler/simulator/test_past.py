"""Sampled worlds and house rules take the robot's earlier events into account."""

from __future__ import annotations

import pickle
from dataclasses import replace

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.declaration import POSE_IN_ROOM
from codebotler.core.skills.kinds import ASK, CHECK, GOTO, PICK, PLACE, SAY
from codebotler.core.skills.paper import SKILLS
from codebotler.core.trace import Event, Option
from codebotler.core.world import Room
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import Rule, RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot

ROOMS = RoomMap(("hall", "kitchen", "lab"), "kitchen")
YES_NO = (Option("yes"), Option("no"))
WORLDS = range(12)


def event(kind: str, text: str, place: str = "kitchen", **more: object) -> Event:
    return replace(Event(kind, text, place=place), **more)  # type: ignore[arg-type]  # names and values of its fields


def robots(*past: Event, rules: tuple[Rule, ...] = ()) -> list[SampledRobot]:
    """Return the robot in several sampled worlds after these events."""
    room_map = replace(ROOMS, past=past)
    guards = [RuleGuard(rules, room_map) if rules else None for _ in WORLDS]
    return [SampledRobot(room_map, FactSampler(0, n), guard=guards[n]) for n in WORLDS]


@pytest.mark.parametrize("found", [True, False])
@pytest.mark.parametrize("what", ["mug", "the mug", "person", "Anne"])
def test_look_finds_the_result_of_the_last_look(what: str, found: bool) -> None:  # noqa: FBT001 - a row of a table
    before = event(CHECK, what, found=not found)
    for robot in robots(before, event(CHECK, what, found=found)):
        assert robot.perform("is_in_room", [what]) is found
    elsewhere = {one.perform("is_in_room", [what]) for one in robots(event(CHECK, what, "lab", found=found))}
    assert elsewhere == {True, False}, "looks in another room must stay random"


def test_what_was_seen_may_change_once_time_passes() -> None:
    seen = [
        event(CHECK, "Anne", found=True),
        event(CHECK, "mug", found=False),
        event(CHECK, "pen", found=True),
    ]
    after: dict[str, set[object]] = {"Anne": set(), "mug": set(), "pen": set()}
    for robot in robots(*seen):
        assert robot.perform("is_in_room", ["Anne"]) is True
        robot.sleep_until(60.0)
        for what, found in after.items():
            found.add(robot.perform("is_in_room", [what]))
        assert robot.facts[0].sentence.startswith("after the first wait, ")
    assert after == {"Anne": {True, False}, "mug": {True, False}, "pen": {True}}


def test_thing_that_could_not_be_picked_up_is_absent() -> None:
    failed = event(PICK, "mug", "lab", failed="PickInvalidObject")
    for robot in robots(event(CHECK, "mug", "lab", found=True), failed, event(GOTO, "kitchen")):
        robot.perform("go_to", ["lab"])
        assert robot.perform("is_in_room", ["mug"]) is False
        with pytest.raises(RobotError) as error:
            robot.perform("pick", ["mug"])
        assert error.value.kind == failed.failed
    unsure = robots(event(PICK, "mug", failed="SkillFailed"))
    assert {one.perform("is_in_room", ["mug"]) for one in unsure} == {True, False}


def test_earlier_answer_is_repeated() -> None:
    asked = event(ASK, "Tea?", options=YES_NO, answer="no", to="Anne")
    for robot in robots(asked):
        assert robot.perform("ask", ["Anne", "Tea?", YES_NO]) == 1
        assert robot.perform("is_in_room", ["Anne"])
    assert len({robot.perform("ask", ["Anne", "Coffee?", YES_NO]) for robot in robots(asked)}) == 2


def test_robot_holds_the_thing_that_it_picked_up() -> None:
    for robot in robots(event(PICK, "mug", "lab")):
        assert (robot.held, robot.room) == ("mug", "kitchen")
        with pytest.raises(RobotError, match="holds"):
            robot.perform("pick", ["plate"])
        robot.perform("place", ["mug"])
        assert robot.perform("is_in_room", ["mug"])
        robot.perform("go_to", ["lab"])


def test_thing_is_where_it_was_put_down() -> None:
    for robot in robots(event(PICK, "mug", "lab"), event(PLACE, "mug", holding="mug")):
        assert robot.held is None
        assert robot.perform("is_in_room", ["mug"])
        robot.perform("pick", ["mug"])


def test_rules_count_earlier_events() -> None:
    once = Rule("once", "Ask once.", parse('not tr.AtLeast(ask(".*", ".*"), 2)'))
    asked = event(ASK, "Tea?", options=YES_NO, answer="no", to="Anne")
    for robot in robots(asked, rules=(once,)):
        with pytest.raises(RuleViolationError):
            robot.perform("ask", ["Anne", "Coffee?", YES_NO])
    for robot in robots(event(SAY, "Tea?"), rules=(once,)):
        robot.perform("ask", ["Anne", "Coffee?", YES_NO])


def test_rules_use_room_names_for_earlier_drives() -> None:
    never_back = Rule(
        "never-back",
        "N.",
        parse('not (tr.Exists(goto("lab")) and tr.AfterFirst(goto("lab")).Exists(goto("kitchen")))'),
    )
    drive = event(GOTO, "the Lab please", "hall", destination="lab")
    for robot in robots(drive, rules=(never_back,)):
        with pytest.raises(RuleViolationError):
            robot.perform("go_to", ["kitchen"])


def test_rules_count_earlier_poses() -> None:
    plan = tuple(
        Room(name, (), (), ((x, 0.0), (x + 1, 0.0), (x + 1, 1.0), (x, 1.0)), (x + 0.5, 0.5))
        for x, name in enumerate(ROOMS.rooms)
    )
    skills = SKILLS.with_skill(POSE_IN_ROOM)
    rule = Rule("inside-twice", "N.", parse('not tr.AtLeast(inside("lab"), 2)', skills=skills))
    room_map = replace(ROOMS, plan=plan, past=(event(GOTO, "lab"), event(GOTO, "kitchen", "lab")))
    robot = SampledRobot(room_map, FactSampler(), guard=RuleGuard((rule,), room_map))
    with pytest.raises(RuleViolationError):
        robot.perform("go_to", ["lab"])


def test_map_with_a_past_can_be_pickled() -> None:
    room_map = replace(ROOMS, past=(event(PICK, "mug"),))
    assert pickle.loads(pickle.dumps(room_map)) == room_map
    assert hash(room_map) == hash(replace(room_map))


@pytest.mark.parametrize(
    "looks", [(("mug", True), ("blue mug", False)), (("blue mug", False), ("mug", True))]
)
def test_looks_distinguish_a_name_within_another(looks: tuple[tuple[str, bool], ...]) -> None:
    for robot in robots(*(event(CHECK, name, found=found) for name, found in looks)):
        assert robot.perform("is_in_room", ["mug"])
        assert not robot.perform("is_in_room", ["blue mug"])


def test_robot_holds_a_thing_from_an_unknown_room() -> None:
    ambiguous = RoomMap(
        ("hall", "kitchen", "lab"), "kitchen", plain=True, past=(event(PICK, "mug", "cellar"),)
    )
    robot = SampledRobot(ambiguous, FactSampler())
    assert robot.held == "mug"
    robot.perform("place", ["mug"])


def test_rules_count_failed_attempts_but_the_world_does_not() -> None:
    once = Rule("once", "Ask once.", parse('not tr.AtLeast(ask(".*", ".*"), 2)'))
    tried = event(ASK, "Tea?", options=YES_NO, to="Anne", failed="AskNoPerson")
    for robot in robots(tried, event(PICK, "mug", failed="PickInvalidObject"), rules=(once,)):
        assert robot.held is None
        with pytest.raises(RuleViolationError):
            robot.perform("ask", ["Anne", "Tea?", YES_NO])
    assert len({one.perform("is_in_room", ["Anne"]) for one in robots(tried)}) == 2
