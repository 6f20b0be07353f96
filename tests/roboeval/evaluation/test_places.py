"""Judging, explaining and searching agree on where events happened and what the robot held."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from codebotler.core.skills.declaration import skill
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.simulation import Simulation
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Outcome
from codebotler.core.world import Person, Room, World
from codebotler.rtl import parse
from codebotler.rtl.semantics import compared_fields
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.settings import SimulationSettings
from codebotler.simulator.worker import Worker
from roboeval.analysis.search import TraceMatch, TraceQuery, search_row
from roboeval.evaluation.judging.explanation import SUITE_CHANGED, completion_data
from roboeval.evaluation.judging.judge import is_met, judge_outcomes, run_in_worlds
from roboeval.evaluation.judging.serialization import row_line
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.rows import decode_row, key_of
from roboeval.evaluation.runs.traces import circumstances, trace_of
from roboeval.suites.load import Requirement, Scenario, Suite, Task
from roboeval.suites.suite import HouseRules

ROOMS = ("office", "bob's office", "lab", "lab 1", "kitchen")
THINGS = ("mug", "red mug", "pen")
OFFICES = World((Room("office"), Room("bob's office"), Room("kitchen", ("mug",))), "kitchen", about="w")
STRICT = SimulationSettings(literals="as-written", matching="whole-words")
SAYS_THERE = 'tr.Exists(at("bob\'s office", say("hi")))'
THERE = "def task_program():\n    go_to(\"bob's office\")\n    say('hi')\n"


WRITTEN = Completion(task="T", prompt=0, index=0, program="")


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    made = Worker()
    yield made
    made.close()


def suite_of(world: World, rules: SimulationSettings, *formulas: str, skills: SkillTable = SKILLS) -> Suite:
    require = tuple(Requirement(one, "is_so", parse(one), "Location") for one in formulas)
    task = Task("T", "s", (), ("p",), (), (), (Scenario(world, require),), None, (), Path("T.yaml"))
    return Suite("mine", 1, "", rules, {"T": task}, "0", skills=skills)


def judge(worker: Worker, suite: Suite, program: str) -> tuple[Outcome, dict[str, Any]]:
    """Run and judge a program, and return its outcome and its row as it is read back."""
    (ran,) = run_in_worlds(suite, worker, [("T", program)], ablated=False)
    judged = judge_outcomes(suite, ran, ablated=False)
    assert judged is not None
    line = row_line(replace(WRITTEN, program=program), judged[0])
    assert key_of(decode_row(line)) == ("T", 0, 0)
    return ran.outcomes[0], json.loads(line)


def explain_all(row: dict[str, Any], suite: Suite) -> list[str]:
    """Explain all requirements as if each had failed."""
    texts = [one.text for one in suite.tasks["T"].scenarios[0].require]
    verdicts = [{**verdict, "failed_checks": texts} for verdict in row["verdicts"]]
    (world,) = completion_data({**row, "verdicts": verdicts}, WRITTEN, suite)["worlds"]
    return [check["explanation"] for check in world["failed_checks"]]


def find(row: dict[str, Any], formula: str) -> TraceMatch:
    return search_row(row, TraceQuery(parse(formula)))


def expect_agreement(worker: Worker, suite: Suite, program: str) -> list[bool]:
    outcome, row = judge(worker, suite, program)
    require = suite.tasks["T"].scenarios[0].require
    met = [is_met(one, outcome.trace) for one in require]
    assert [why.startswith(SUITE_CHANGED) for why in explain_all(row, suite)] == met
    assert [bool(find(row, one.text).worlds) for one in require] == met
    return met


@pytest.mark.parametrize("matching", ["whole-words", "label-in-request"])
def test_names_of_rooms_may_contain_each_other(worker: Worker, matching: Any) -> None:  # noqa: ANN401 - a literal
    rules = SimulationSettings(literals="as-written", matching=matching)
    suite = suite_of(OFFICES, rules, SAYS_THERE, 'tr.Exists(at("kitchen", goto("office")))')
    assert expect_agreement(worker, suite, THERE) == [matching == "whole-words", True]


# --- random worlds, programs and formulas


@st.composite
def worlds(draw: st.DrawFn) -> World:
    names = draw(st.permutations(ROOMS))[: draw(st.integers(2, 5))]
    rooms = [
        Room(name, tuple(draw(st.lists(st.sampled_from(THINGS), max_size=2))), (Person("amy", ("yes",)),))
        for name in names
    ]
    return World(tuple(rooms), names[0], about="w")


REQUESTS = st.sampled_from([*ROOMS, "bob's office, please", "labs", "moon"])
CALLS = st.one_of(
    st.builds("go_to({!r})".format, REQUESTS),
    st.builds("say({!r})".format, st.sampled_from(["hi", "bye"])),
    st.builds("pick({!r})".format, st.sampled_from(THINGS)),
    st.builds("place({!r})".format, st.sampled_from(THINGS)),
    st.builds("is_in_room({!r})".format, st.sampled_from([*THINGS, "amy"])),
    st.builds("ask({!r}, 'tea?', ['yes', 'no'])".format, st.sampled_from(["amy", "bob"])),
)
PROGRAMS = st.lists(CALLS, max_size=8).map(
    lambda calls: "".join(
        ["def task_program():\n    pass\n"]
        + [f"    try:\n        {call}\n    except Exception:\n        pass\n" for call in calls]
    )
)
DEEDS = st.one_of(
    st.builds("{}(r'.*')".format, st.sampled_from(["goto", "say", "pick", "place", "check"])),
    st.builds("to({!r}, ask('tea', '.*'))".format, st.sampled_from(["amy", "bob"])),
)
ELEMENTS = st.one_of(
    st.builds("at({!r}, {})".format, st.sampled_from(ROOMS), DEEDS),
    st.builds("holding({!r}, {})".format, st.sampled_from(THINGS), DEEDS),
    st.builds("at({!r}, holding({!r}, {}))".format, st.sampled_from(ROOMS), st.sampled_from(THINGS), DEEDS),
    DEEDS,
)
SCOPES = st.one_of(
    st.just(""),
    st.builds(".{}({})".format, st.sampled_from(["BeforeFirst", "AfterLast", "OnlyAfterFirst"]), ELEMENTS),
)
TESTS = st.one_of(
    st.builds("tr{}.Exists({})".format, SCOPES, ELEMENTS),
    st.builds("tr{}.Last({})".format, SCOPES, ELEMENTS),
    st.builds("tr{}.AtLeast({}, 2)".format, SCOPES, ELEMENTS),
)
FORMULAS = st.recursive(
    TESTS,
    lambda parts: st.one_of(
        st.builds("not ({})".format, parts),
        st.builds("({}) and ({})".format, parts, parts),
        st.builds("({}) or ({})".format, parts, parts),
    ),
    max_leaves=3,
)
RULES = st.builds(
    SimulationSettings,
    literals=st.just("as-written"),
    matching=st.sampled_from(["whole-words", "label-in-request"]),
    events=st.sampled_from(["as-requested", "as-happened"]),
)


def expect_the_same_answers(
    worker: Worker, world: World, rules: SimulationSettings, program: str, formulas: list[str]
) -> None:
    suite = suite_of(world, rules, *dict.fromkeys(formulas))
    expect_agreement(worker, suite, program)
    outcome, row = judge(worker, suite, program)
    (shown,) = completion_data(row, WRITTEN, suite)["worlds"]
    assert [(step["place"], step.get("to")) for step in shown["steps"]] == [
        (event.place, event.destination) for event in outcome.trace
    ]


SOME_FORMULAS = st.lists(FORMULAS, min_size=3, max_size=5)


AS_HAPPENED = replace(STRICT, events="as-happened")
CARRIES = """def task_program():
    go_to("bob's office, please")
    ask("bob", "tea?", ["yes", "no"])
    go_to("kitchen")
    pick("mug")
    say("hi")
"""
ABOUT_CARRYING = [
    "tr.Exists(at(\"bob's office\", to('bob', ask('tea', '.*'))))",
    "not tr.Exists(holding('mug', pick('mug'))) and tr.Last(at('kitchen', holding('mug', say('hi'))))",
    "tr.OnlyAfterFirst(at('kitchen', goto(r'.*'))).Exists(at('^office', say('hi')))",
]


@settings(max_examples=2)
@example(OFFICES, STRICT, THERE, [SAYS_THERE])
@example(OFFICES, SimulationSettings(), THERE, [SAYS_THERE])
@example(OFFICES, STRICT, CARRIES, ABOUT_CARRYING)
@example(OFFICES, AS_HAPPENED, CARRIES, ABOUT_CARRYING)
@given(worlds(), RULES, PROGRAMS, SOME_FORMULAS)
def test_judge_explanations_and_searches_agree(
    worker: Worker, world: World, rules: SimulationSettings, program: str, formulas: list[str]
) -> None:
    expect_the_same_answers(worker, world, rules, program, formulas)


@pytest.mark.slow
@settings(max_examples=300)
@given(worlds(), RULES, PROGRAMS, SOME_FORMULAS)
def test_judge_explanations_and_searches_agree_at_length(
    worker: Worker, world: World, rules: SimulationSettings, program: str, formulas: list[str]
) -> None:
    expect_the_same_answers(worker, world, rules, program, formulas)


# --- drives that fail, skills of a user's own, processes


def test_failed_drives_have_no_destination(worker: Worker) -> None:
    program = "def task_program():\n    go_to('kitchen')\n    go_to('moon')\n"
    suite = suite_of(OFFICES, STRICT, 'tr.Exists(at("kitchen", goto("moon")))')
    _, row = judge(worker, suite, program)
    (verdict,) = row["verdicts"]
    assert (verdict["places"], verdict["destinations"]) == ([[1, "kitchen"]], [[2, None]])
    (world,) = completion_data(row, WRITTEN, suite)["worlds"]
    assert [step["to"] for step in world["steps"]] == ["kitchen", None]
    assert find(row, 'tr.Exists(at("kitchen", goto("moon")))').worlds


@skill(names="object")
def bring_from_kitchen(sim: Simulation, obj: str) -> None:
    """Get an object from the kitchen."""
    sim.drive("kitchen")
    sim.take(obj)


def test_events_in_a_users_own_skill_have_places(worker: Worker) -> None:
    world = World(OFFICES.rooms, "office", about="w")
    formulas = (
        'tr.Exists(at("kitchen", pick("mug")))',
        'tr.Exists(at("^office", goto("kitchen")))',
        'tr.Exists(at("kitchen", holding("mug", say("got"))))',
    )
    suite = suite_of(world, STRICT, *formulas, skills=SKILLS.with_skill(bring_from_kitchen))
    program = "def task_program():\n    bring_from_kitchen('mug')\n    say('got it')\n"
    assert expect_agreement(worker, suite, program) == [True, True, True]
    _, row = judge(worker, suite, program)
    (world_shown,) = completion_data(row, WRITTEN, suite)["worlds"]
    drive = next(step for step in world_shown["steps"] if step["kind"] == "goto")
    assert (drive["place"], drive["to"]) == ("office", "kitchen")


def test_a_run_that_a_rule_ends_has_places(worker: Worker) -> None:
    rule = Rule("quiet", "Be quiet in the office.", parse('not tr.Exists(at("office", say(".*")))'))
    formula = 'tr.Last(at("kitchen", goto("office")))'
    suite = replace(suite_of(OFFICES, STRICT, formula), house=HouseRules("", (rule,), "0"))
    program = "def task_program():\n    pick('mug')\n    go_to('office')\n    say('hi')\n"
    outcome, row = judge(worker, suite, program)
    (verdict,) = row["verdicts"]
    assert (verdict["status"], verdict["error"]["kind"]) == ("robot-error", "RuleViolation")
    assert trace_of(verdict) == outcome.trace
    assert compared_fields(trace_of(verdict)) == compared_fields(outcome.trace)
    assert (verdict["places"], verdict["holding"]) == ([[1, "kitchen"], [3, "office"]], [[2, "mug"]])
    assert expect_agreement(worker, suite, program) == [True]


PROGRAM = (
    "def task_program():\n    pick('mug')\n    go_to('office')\n    say('hi')\n    place('mug')\n"
    "    for n in range(60):\n        say('waiting')\n    go_to('kitchen')\n"
)


def test_both_kinds_of_processes_record_places(worker: Worker) -> None:
    suite = suite_of(OFFICES, STRICT)
    outcome, row = judge(worker, suite, PROGRAM)
    alone = Worker(one_process_per_run=True)
    other, same = judge(alone, suite, PROGRAM)
    alone.close()
    assert row == same
    assert compared_fields(other.trace) == compared_fields(outcome.trace)
    assert circumstances(outcome.trace) == {
        "places": [[1, "kitchen"], [3, "office"], [66, "kitchen"]],
        "holding": [[2, "mug"], [5, ""]],
    }
    assert (outcome.trace[2].place, outcome.trace[2].holding) == ("office", "mug")
