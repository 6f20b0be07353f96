"""Random programs end alike in every run, with and without isolation, and nothing of ours breaks.

`make test` runs the same 200 each time. `make fuzz` runs thousands of others: FUZZ_EXAMPLES says how many.
"""

import ast
import os
import re
import warnings
from collections import Counter
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, example, given, note, settings
from hypothesis import strategies as st

from codebotler.core.program import Flaw, Program
from codebotler.core.trace import Outcome, Status
from codebotler.core.world import Person, Room, World
from codebotler.simulator.engine import run
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.robot import SimulatedRobot
from codebotler.simulator.rules import Limits, Rules
from in_process import OrdinaryProcess, without_addresses
from random_programs import broken_programs, programs

NIGHTLY = "FUZZ_EXAMPLES" in os.environ
EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "200"))
FUZZ = settings(
    max_examples=EXAMPLES,
    derandomize=not NIGHTLY,
    database=None,
    deadline=None,
    # Programs are long, and the machine may be busy.
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example],
)
RULES = Rules(limits=Limits(ticks=2_000, calls=60))

CLOSED_BY_AN_ERROR = """
def spoken():
    try:
        yield
    finally:
        say("closed")

def task_program():
    waiting = spoken()
    next(waiting)
    pick("nothing")
"""

DEEP = """
deepest = 0

def deeper(n):
    global deepest
    deepest = n
    deeper(n + 1)

def task_program():
    try:
        deeper(0)
    except RecursionError:
        say(str(deepest))
"""
AMY = Person("amy", ("yes", "no", "hello|kitchen", ".*"))
BOB = Person(".*", ("no", "yes"))
NEVER = Person("x")
WORLDS = (
    World(
        (
            Room("start_loc", ("mug",), (BOB,)),
            Room("kitchen", ("apple", "mug"), (AMY,)),
            Room("conference room", ("stapler",)),
            Room("amy's lab", (), (Person("amy", ("Yes",)),)),
        ),
        "start_loc",
    ),
    World(
        (Room("start_loc"), Room("amy's lab", ("apple", "apple"), (AMY, BOB)), Room("lab", ("stapler",))),
        "start_loc",
    ),
    World(
        (
            Room("kitchen", ("apple", "red"), (AMY,)),
            Room("start_loc"),
            Room("conference room", (), (NEVER,)),
        ),
        "kitchen",
    ),
)


@pytest.fixture(scope="module")
def pool() -> Iterator[WorkerPool]:
    with WorkerPool(1) as pool:
        yield pool


@pytest.fixture(scope="module")
def other_pool() -> Iterator[WorkerPool]:
    with WorkerPool(1) as pool:
        yield pool


@pytest.fixture(scope="module")
def ordinary() -> Iterator[OrdinaryProcess]:
    with OrdinaryProcess(RULES) as process:
        yield process


def outcome_of(pool: WorkerPool, source: str, world: World) -> Outcome:
    return pool.here().run(source, lambda: SimulatedRobot(world, RULES))


def all_of(outcome: Outcome) -> str:
    """Everything in an outcome, with the places and times that its comparison leaves out."""
    return repr(outcome)


def names_bound(source: str) -> set[str]:
    """The names that a program gives a meaning anywhere, or declares global, which is taken for it."""
    with warnings.catch_warnings(action="ignore"):
        nodes = list(ast.walk(ast.parse(source)))
    names = {node.id for node in nodes if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load)}
    for attribute in ("name", "arg", "asname", "rest"):
        names |= {str(getattr(node, attribute, None)).split(".")[0] for node in nodes}
    return names.union(*(node.names for node in nodes if isinstance(node, ast.Global)))


def check_problems(source: str, problems: tuple[Flaw, ...], outcome: Outcome) -> None:
    """What is said of a program before it runs is true.

    A name may be bound in a branch that is not taken, or deleted, and a name in a program of a program is not
    looked at; but a name that is bound nowhere at all is found.
    """
    if outcome.error is None:
        assert not any(problem.line is None for problem in problems)
        return
    said = re.fullmatch(r"(?:cannot access free variable|name) '(\w+)' .*", outcome.error.message)
    if outcome.error.kind == "NameError" and said and outcome.line:
        told = Flaw(outcome.line, "NameError", f"the name {said[1]} is not defined")
        assert told in problems or said[1] in names_bound(source)


def test_random_programs_end_alike_isolated_or_not_and_in_every_run(
    pool: WorkerPool, other_pool: WorkerPool, ordinary: OrdinaryProcess
) -> None:
    seen: dict[tuple[str, World], Outcome] = {}

    @FUZZ
    @given(programs(deep=False), st.sampled_from(WORLDS))
    @example("def task_program():\n    say(undefined_name)\n", WORLDS[0])
    @example(DEEP, WORLDS[0])
    @example(CLOSED_BY_AN_ERROR, WORLDS[0])
    def check(source: str, world: World) -> None:
        note(source)
        outcome = seen[source, world] = outcome_of(pool, source, world)
        assert outcome.status is not Status.KILLED
        assert all_of(outcome_of(other_pool, source, world)) == all_of(outcome)
        assert without_addresses(ordinary.outcome(source, world)) == without_addresses(outcome)
        check_problems(source, Program(source).problems(), outcome)

    check()
    assert list(map(all_of, run(seen, workers=3, rules=RULES))) == list(map(all_of, seen.values()))
    count = Counter(outcome.status for outcome in seen.values())
    assert count[Status.FINISHED] >= len(seen) / 3
    for status in (Status.PYTHON_ERROR, Status.ROBOT_ERROR, Status.TIMEOUT):
        assert count[status] >= len(seen) / 60, count
    assert sum(map(len, (outcome.trace for outcome in seen.values()))) >= 2 * len(seen)


def test_recursion_through_anything_ends_alike_in_every_run(pool: WorkerPool, other_pool: WorkerPool) -> None:
    """How deep it goes is Python's own, and differs by where the interpreter has started."""

    @settings(FUZZ, max_examples=EXAMPLES // 4)
    @given(programs(), st.sampled_from(WORLDS))
    def check(source: str, world: World) -> None:
        note(source)
        outcome = outcome_of(pool, source, world)
        assert outcome.status is not Status.KILLED
        assert all_of(outcome_of(other_pool, source, world)) == all_of(outcome)

    check()


@pytest.mark.slow
def test_broken_texts_end_alike_in_every_run_and_break_nothing(
    pool: WorkerPool, other_pool: WorkerPool
) -> None:
    @FUZZ
    @given(broken_programs(), st.sampled_from(WORLDS))
    @example("def task_program():\n    \0\n", WORLDS[0])
    def check(source: str, world: World) -> None:
        note(source)
        outcome = outcome_of(pool, source, world)
        assert outcome.status is not Status.KILLED
        assert all_of(outcome_of(other_pool, source, world)) == all_of(outcome)
        problems = Program(source).problems()
        check_problems(source, problems, outcome)
        if len(problems) == 1 and problems[0].kind in {"SyntaxError", "IndentationError", "TabError"}:
            assert outcome.trace == ()
            assert outcome.error is not None
            assert (outcome.error.kind, outcome.line) == (problems[0].kind, problems[0].line)

    check()
