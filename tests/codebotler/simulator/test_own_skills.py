"""Custom skills in simulation: their random results, and failed attempts that count for house rules."""

from collections.abc import Sequence

import pytest

from codebotler import PersonName, RoomName, Simulation, ThingName, skill
from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill
from codebotler.core.world import Person, Room, World
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import Rule, RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.robot import SimulatedRobot
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot


@skill(fails={"NotFound": "it is not there"})
def search_for(sim: Simulation, what: str) -> bool:
    """Search for a thing."""
    if not sim.truth(f"{what} is there"):
        sim.fail("NotFound")
    return True


@skill
def pour_out(sim: Simulation, what: str) -> None:
    """Pour a liquid."""


@skill
def describe(sim: Simulation) -> str:  # type: ignore[empty-body]  # its result is random
    """Describe the room."""


@skill
def choose_room(sim: Simulation) -> RoomName:  # type: ignore[empty-body]  # its result is random
    """Choose a room."""


@skill
def choose_things(sim: Simulation) -> list[ThingName]:  # type: ignore[empty-body]  # its result is random
    """Choose some things."""


@skill
def choose_person(sim: Simulation) -> PersonName:  # type: ignore[empty-body]  # its result is random
    """Choose a person."""


OWN_SKILLS = (search_for, pour_out, describe, choose_room, choose_things, choose_person)
TABLE = SKILLS
for _skill in OWN_SKILLS:
    TABLE = TABLE.with_skill(_skill)
WORLD = World(
    (Room("hall", ("mug", "cup|glass")), Room("lab", ("pen",), (Person("ann"),))),
    "hall",
    truths=(("Water is there", True), ("floor is there", False)),
)


def robots(rules: Sequence[Rule] = (), samples: int = 1) -> list[SimulatedRobot]:
    guard = (lambda: RuleGuard(rules)) if rules else (lambda: None)
    room_map = RoomMap.of(WORLD)
    sampled = [
        SampledRobot(room_map, FactSampler(sample=n), skills=TABLE, guard=guard()) for n in range(samples)
    ]
    return [SimulatedRobot(WORLD, skills=TABLE, guard=guard()), *sampled]


def random_results(row: Skill) -> set[object]:
    results = (one.perform(row.name, []) for one in robots(samples=60))
    return {each for result in results for each in (result if isinstance(result, list) else [result])}


def test_random_texts_are_never_empty() -> None:
    texts = random_results(describe)
    assert len(texts) > 1
    assert all(texts)


def test_random_names_are_those_of_the_world() -> None:
    assert random_results(choose_room) == {"hall", "lab"}
    assert random_results(choose_things) == {"mug", "pen"}
    assert random_results(choose_person) == {"ann"}


def test_signature_shows_names_as_texts() -> None:
    assert choose_things.signature == "choose_things() -> list[str]"


def test_truths_ignore_capitals() -> None:
    assert SimulatedRobot(WORLD, skills=TABLE).perform("search_for", ["water"]) is True


@pytest.mark.parametrize(
    "robot",
    robots(
        [
            Rule(
                "dry",
                "Do not pour_out.",
                parse('not tr.Exists(search_for("floor")) or not tr.Exists(pour_out(".*"))', skills=TABLE),
            )
        ]
    ),
)
def test_a_failed_attempt_counts_for_house_rules_but_is_not_in_the_trace(robot: SimulatedRobot) -> None:
    with pytest.raises(RobotError) as failed:
        robot.perform("search_for", ["floor"])
    assert failed.value.kind == "NotFound"
    assert robot.trace == ()
    with pytest.raises(RuleViolationError):
        robot.perform("pour_out", ["water"])
