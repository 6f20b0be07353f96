"""Explorations cover all worlds of some rooms, and their verdicts on rules hold in each world."""

from collections.abc import Iterator
from itertools import product

import pytest

from codebotler.checking import exploration
from codebotler.checking.exploration import Exploration, explore
from codebotler.checking.sampled import CheckSettings, SampledRuns
from codebotler.core.trace import Outcome
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.fact_sampler import Draw, FactSampler
from codebotler.simulator.worlds.room_map import RoomMap

ROOMS = RoomMap(("start", "kitchen", "lab"), "start")
NO_LAB = Rule("no-lab", "Never go to the lab.", parse('not tr.Exists(goto("lab"))'))
BACK = Rule("back", "Be back at the end.", parse('tr.Last(goto("start"))'), "finally")

SEARCH = """
def task_program():
    found = []
    for room in get_all_rooms():
        go_to(room)
        if is_in_room("mug"):
            found.append(room)
    go_to("start")
    say(", ".join(found))
"""
NEEDS_EQUAL_FACTS = """
def task_program():
    count = 0
    for room in ["start", "kitchen"]:
        go_to(room)
        if is_in_room("mug") and is_in_room("cup"):
            count += 1
    if count == 2 and ask("", "Tea?", ["yes", "no", "maybe"]) == "maybe":
        go_to("lab")
    go_to("start")
"""
DRIVES_AFTER_AN_ERROR = """
def task_program():
    try:
        pick("mug")
    except Exception:
        go_to("lab")
"""
WILD_SEARCH = SEARCH.replace("found = []", "found = type('L', (list,), {})()")


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    started = Worker()
    yield started
    started.close()


def explore_rooms(worker: Worker, program: str, *rules: Rule, room_map: RoomMap = ROOMS) -> Exploration:
    return explore(worker, program, room_map, CheckSettings(1, house_rules=rules))


def run_in(worker: Worker, program: str, sampler: FactSampler) -> Outcome:
    runs = SampledRuns(program, ROOMS, [sampler], CheckSettings(1))
    return runs.samples_on(worker, {})[0].outcome


def facts(**values: int) -> Iterator[tuple[Draw, ...]]:
    """Yield all combinations of whether each thing is in each room, and of the answers to a question."""
    looks = [("is_there", (room, name)) for name in ("mug", "cup") for room in ("start", "kitchen", "lab")]
    for there in product((True, False), repeat=len(looks)):
        for answer in range(values.get("answers", 1)):
            found = [Draw("is_there", given, result) for (_, given), result in zip(looks, there, strict=True)]
            asked = Draw("answer", (3, 0, "start", "somebody", "Tea?"), answer)
            elsewhere = Draw("answer", (3, 0, "kitchen", "somebody", "Tea?"), answer)
            yield (*found, asked, elsewhere)


def test_each_combination_of_facts_is_explored_once(worker: Worker) -> None:
    found = explore_rooms(worker, SEARCH)
    assert found.is_complete
    assert found.cases == 2**3
    said = {call.texts[0][0] for call in found.calls if call.skill == "say"}
    assert said == {", ".join(rooms) for rooms in _subsets(ROOMS.rooms)}
    assert found.most_calls["go_to"] == 4


def _subsets(rooms: tuple[str, ...]) -> Iterator[list[str]]:
    for there in product((True, False), repeat=len(rooms)):
        yield [room for room, is_there in zip(rooms, there, strict=True) if is_there]


@pytest.mark.slow  # hundreds of runs
@pytest.mark.parametrize("program", [SEARCH, NEEDS_EQUAL_FACTS, DRIVES_AFTER_AN_ERROR])
def test_exploration_finds_a_violation_if_and_only_if_a_world_has_one(worker: Worker, program: str) -> None:
    found = explore_rooms(worker, program, NO_LAB)
    outcomes = [
        run_in(worker, program, FactSampler(strict=strict, forced=forced))
        for forced in facts(answers=3)
        for strict in (False, True)
    ]
    is_broken = any(event.text == "lab" and event.kind == "goto" for one in outcomes for event in one.trace)
    assert found.is_complete
    assert ("no-lab" in found.violations) == is_broken


def test_violation_that_needs_many_equal_facts_is_found_with_its_world(worker: Worker) -> None:
    found = explore_rooms(worker, NEEDS_EQUAL_FACTS, NO_LAB, BACK)
    assert found.is_complete
    assert set(found.violations) == {"no-lab"}
    outcome = run_in(worker, NEEDS_EQUAL_FACTS, found.violations["no-lab"])
    assert ("goto", "lab") in {(event.kind, event.text) for event in outcome.trace}


def test_wrong_assumptions_are_explored(worker: Worker) -> None:
    found = explore_rooms(worker, DRIVES_AFTER_AN_ERROR, NO_LAB)
    assert found.violations["no-lab"].strict


def test_rules_are_judged_independently(worker: Worker) -> None:
    program = "def task_program():\n    go_to('lab')\n    go_to('kitchen')\n"
    assert set(explore_rooms(worker, program, NO_LAB, BACK).violations) == {"no-lab", "back"}


def test_an_exploration_ends_at_its_budget(worker: Worker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exploration, "MAX_RUNS", 5)
    found = explore_rooms(worker, SEARCH)
    assert found.cases == 5
    assert not found.is_complete


def test_wild_programs_are_explored(worker: Worker) -> None:
    found = explore_rooms(worker, WILD_SEARCH)
    assert found.is_complete
    assert found.calls == explore_rooms(worker, SEARCH).calls


def test_endless_run_has_no_maximum_of_calls(worker: Worker) -> None:
    program = (
        "def task_program():\n    while not is_in_room('mug'):\n        time.sleep(60)\n    say('here')\n"
    )
    found = explore_rooms(worker, program)
    assert found.is_complete
    assert not found.most_calls
    assert "say" in {call.skill for call in found.calls}


def test_refusal_makes_the_exploration_incomplete(worker: Worker) -> None:
    refusing = Rule("no-lab", NO_LAB.says, NO_LAB.formula, refuse=True)
    program = "def task_program():\n    go_to('lab')\n"
    assert not explore_rooms(worker, program, refusing).is_complete
    assert explore_rooms(worker, program.replace("lab", "kitchen"), refusing).is_complete


def test_a_program_that_catches_errors_also_runs_on_a_robot_that_fails_once(worker: Worker) -> None:
    program = """
def task_program():
    home = get_current_location()
    for room in get_all_rooms():
        if room == "lab":
            try:
                go_to(room)
            except Exception:
                go_to(home)
                say("no way to the " + room)
"""
    calls = explore_rooms(worker, program).calls
    assert {call.texts[0] for call in calls if call.skill == "go_to"} == {("lab",), ("start",)}
    assert ("no way to the lab",) in {call.texts[0] for call in calls if call.skill == "say"}


WAITS_FOR_ANN = """
def task_program():
    tries = 0
    while not is_in_room("Ann") and tries < 3:
        time.sleep(60)
        tries += 1
    if is_in_room("Ann") and tries > 0:
        go_to("lab")
"""


def test_facts_that_may_change_make_the_result_unsteady(worker: Worker) -> None:
    found = explore_rooms(worker, WAITS_FOR_ANN, NO_LAB)
    assert (found.is_complete, found.is_steady) == (True, False)
    assert explore_rooms(worker, SEARCH).is_steady


def test_failures_that_lead_to_other_calls_make_the_result_unsteady(worker: Worker) -> None:
    program = """
def task_program():
    try:
        go_to('kitchen')
    except Exception:
        go_to('lab')
"""
    assert not explore_rooms(worker, program, NO_LAB).is_steady
    assert explore_rooms(worker, program.replace("go_to('lab')", "pass"), NO_LAB).is_steady


def test_an_exploration_ends_at_its_budget_of_calls(worker: Worker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exploration, "MAX_CALLS", 10)
    monkeypatch.setattr(exploration, "RUNS_AT_ONCE", 1)
    assert not explore_rooms(worker, SEARCH).is_complete
