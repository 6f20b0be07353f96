"""Each operator by an example: what it changes in a program and in the robot's actions."""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Literal, TypedDict

import pytest
import yaml

from codebotler.core.skills import declaration
from codebotler.core.skills.declaration import skill
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.simulation import Simulation
from codebotler.core.trace import Event, Outcome, Status
from codebotler.core.world import Person, Room, World
from codebotler.simulator.engine import run
from codebotler.simulator.settings import Limits, SimulationSettings
from roboeval.mutation.mutants import MUTATION_OPERATORS
from roboeval.mutation.operator import Context, Operator
from roboeval.mutation.program_tree import apply_edit, parse_tree

WORLD = World(
    rooms=(
        Room("hall"),
        Room("alice's office", people=(Person("alice", ("yes",)),)),
        Room("bob's office", people=(Person("bob", ("no",)),)),
        Room("store", objects=("mug", "stapler")),
        Room("lobby"),
    ),
    robot="hall",
)
CONTEXT = Context.of([WORLD])
RULES = SimulationSettings(literals="as-written", limits=Limits(calls=20))


@skill(fails={"CupFull": "the cup is full"})
def pour(sim: Simulation, cup: str, size: Literal["small", "large"]) -> bool:  # noqa: ARG001 - the signature that programs call
    """Pour something into a cup; False if it runs out of it."""
    if cup == "full":
        sim.fail("CupFull")
    return cup != "sieve"


TABLE = SKILLS.with_skill(pour)


@pytest.fixture(autouse=True)
def register_pour(monkeypatch: pytest.MonkeyPatch) -> None:
    """Register this skill, even if an earlier test has registered another one by this name."""
    monkeypatch.setitem(declaration._DECLARED, "pour", pour)


BY_NAME = {operator.name: operator for operator in MUTATION_OPERATORS}


class Example(TypedDict):
    """An operator's change to the body of a `task_program`, and what the robot does before and after."""

    operator: str
    before: str
    after: str
    did: str
    does: str


EXAMPLES: list[Example] = yaml.safe_load(Path(__file__).with_name("operators.yaml").read_text())
NAMES = [example["operator"] for example in EXAMPLES]


def program(body: str) -> str:
    """Return a program with this body, in the form that comes from its tree."""
    return ast.unparse(ast.parse("def task_program():\n" + textwrap.indent(body, "    ")))


def mutants(operator: Operator, body: str) -> Iterator[str]:
    """Yield the mutants that an operator makes of a body."""
    source = parse_tree(program(body))
    assert source is not None
    found = (apply_edit(source, edit) for edit in operator.edits(source, CONTEXT))
    yield from (one for one in found if one is not None)


@cache
def run_examples() -> dict[str, Outcome]:
    """Run all programs of the examples."""
    programs = [program(body) for example in EXAMPLES for body in (example["before"], example["after"])]
    ended = run(((source, WORLD) for source in programs), workers=2, settings=RULES, skills=TABLE)
    return dict(zip(programs, ended, strict=True))


def describe(outcome: Outcome) -> str:
    """Describe in one line what a robot did."""
    end = "" if outcome.status is Status.FINISHED else f"({outcome.error.kind if outcome.error else ''})"
    return "; ".join([*map(describe_event, outcome.trace[:8]), *([end] if end else [])])


def describe_event(event: Event) -> str:
    found = {None: "", True: ": yes", False: ": no"}[event.found]
    return f"{event.kind} {event.text}{found}{'' if event.answer is None else ': ' + event.answer}"


def test_each_operator_has_an_example_a_name_and_a_sentence() -> None:
    assert [operator.name for operator in MUTATION_OPERATORS] == NAMES
    assert len(BY_NAME) == len(MUTATION_OPERATORS)
    for operator in MUTATION_OPERATORS:
        assert re.fullmatch(r"[a-z]+(-[a-z]+)*", operator.name)
        assert re.fullmatch(r"[A-Z].+\.", operator.about)


@pytest.mark.parametrize("example", EXAMPLES, ids=NAMES)
def test_an_operator_makes_the_mutant_of_its_example(example: Example) -> None:
    made = list(mutants(BY_NAME[example["operator"]], example["before"]))
    assert program(example["after"]) in made
    assert program(example["before"]) not in made


@pytest.mark.parametrize("example", EXAMPLES, ids=NAMES)
def test_the_mutant_makes_the_robot_act_differently(example: Example) -> None:
    did, does = (run_examples()[program(example[body])] for body in ("before", "after"))
    assert describe(did) == example["did"]
    assert describe(does) == example["does"]
    assert describe(did) != describe(does)


LEFT_ALONE = {
    "off-by-one": ("import time\ntime.sleep(1)", "say(str(72 + 3))"),
    "see-nothing": ("is_in_room('person') or is_in_room('bob')", "is_in_room('bob')"),
    "and-or": ("say(str(is_in_room('person') or is_in_room('bob')))",),
    "drop-the-else": ("import time\nif True:\n    say('a')\nelse:\n    time.sleep(1)",),
    "swap-steps": ("say('hello')\nsay('good day')", "n = 1\nsay('hello')"),
    "wrong-thing": ("pick('red mug with a stapler')",),
    "swap-values": ("for kind in ['mug']:\n    say(f'{kind}: {len(kind)}')",),
    "vague-question": ("ask('bob', 'What would you like?', ['tea', 'water'])",),
    "drop-the-return": ("go_to('lobby')",),
    "say-before-asking": ("answer = ask('bob', 'Lunch?', ['yes', 'no'])\nsay(answer)",),
    "drop-a-condition": ("while get_current_location() != 'lobby':\n    go_to('lobby')",),
}
"""Bodies that an operator must not change: no mutant would be wrong, or it would not be a program."""


@pytest.mark.parametrize(("name", "body"), [(name, body) for name in LEFT_ALONE for body in LEFT_ALONE[name]])
def test_an_operator_leaves_some_bodies_alone(name: str, body: str) -> None:
    assert list(mutants(BY_NAME[name], body)) == []


def test_positional_and_keyword_arguments_are_the_same_to_operators() -> None:
    body = "start = get_current_location()\ngo_to(location={})\nsay(message='hello')"
    assert program(body.format("get_current_location()")) in mutants(
        BY_NAME["return-to-here"], body.format("start")
    )


def test_only_one_spelling_of_a_person_is_replaced() -> None:
    assert list(mutants(BY_NAME["wrong-person"], "say('BOB and bob')")) == [program("say('Alice and bob')")]


LEFT_OUT = [
    (
        "drop-the-return",
        "start = get_current_location()\ngo_to('lobby')\ngo_to(start)",
        "Go there and come back.",
    ),
    ("detour", "go_to('lobby')", "Take it straight to the lobby."),
    ("forget-to-say", "say('It is done.')", "Do it and tell me."),
]


@pytest.mark.parametrize(("name", "body", "asking"), LEFT_OUT, ids=[name for name, *_ in LEFT_OUT])
def test_actions_that_no_phrasing_asks_for_have_no_mutants(name: str, body: str, asking: str) -> None:
    source = parse_tree(program(body))
    assert source is not None
    made = {
        phrasings: len([*BY_NAME[name].edits(source, Context.of([WORLD], phrasings))])
        for phrasings in ((), ("Go to the lobby.",), ("Go to the lobby.", asking))
    }
    assert [*made.values()] == [1, 0, 1]


@pytest.mark.parametrize(
    ("phrasings", "made"),
    [
        (("Bring it to the lobby.",), 1),
        (("Fetch it here.",), 0),
        (("Bring it back here and put it down.",), 1),
        (("Bring it back here and put it down.", "Come back with it."), 0),
    ],
)
@pytest.mark.parametrize("name", ["forget-to-place", "place-by-words"])
def test_objects_to_bring_here_need_not_be_put_down(name: str, phrasings: tuple[str, ...], made: int) -> None:
    source = parse_tree(program("pick('mug')\nplace('mug')"))
    assert source is not None
    assert len([*BY_NAME[name].edits(source, Context.of([WORLD], phrasings))]) == made
