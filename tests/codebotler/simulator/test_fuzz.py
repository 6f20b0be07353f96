"""Random programs have the same outcome in every run, isolated or not, alone or in a shared child.

`make test` runs the same 20 each time. `make fuzz` runs thousands of others. FUZZ_EXAMPLES is their number,
and FUZZ_SEED chooses the order in which they share children and the programs of the corpus.
"""

import ast
import json
import os
import re
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from random import Random
from typing import TypeVar

import pytest
from hypothesis import HealthCheck, example, given, note, seed, settings
from hypothesis import strategies as st
from hypothesis.internal.conjecture import providers
from hypothesis.internal.constants_ast import Constants

from codebotler.core.program import Flaw
from codebotler.core.trace import Outcome, Status
from codebotler.core.world import Person, Room, World
from codebotler.simulator.engine import run
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.settings import PAPER_SETTINGS, Limits, SimulationSettings
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import SimulatedRobot
from flaws import find_flaws
from in_process import OrdinaryProcess, all_of, without_addresses
from random_programs import broken_programs, programs, tame_programs
from roboeval.suites.load import Suite

NIGHTLY = "FUZZ_EXAMPLES" in os.environ
EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "20"))
SEED = int(os.environ.get("FUZZ_SEED", "0"))
FUZZ = settings(
    max_examples=EXAMPLES,
    database=None,
    deadline=None,
    # Programs are long and the machine may be busy, so these checks of Hypothesis would fail at random.
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example],
)
Check = TypeVar("Check", bound=Callable[..., None])
SETTINGS = SimulationSettings(limits=Limits(ticks=2_000, calls=60))

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

FAILED_WHILE_CLOSED = """
def spoken():
    try:
        yield
    finally:
        pick("nothing")

def task_program():
    next(spoken())
    waiting = spoken()
    next(waiting)
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


def use_fixed_seed(check: Check) -> Check:
    """Fix the seed outside nightly runs, since Hypothesis derives one from the text of the test."""
    return check if NIGHTLY else seed(SEED)(check)


@pytest.fixture(autouse=True)
def ignore_constants_of_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw the same programs in each process, since Hypothesis also draws constants of loaded modules."""
    monkeypatch.setattr(providers, "_get_local_constants", Constants)
    monkeypatch.setattr(providers, "CONSTANTS_CACHE", type(providers.CONSTANTS_CACHE)(1024))


@pytest.fixture(scope="module")
def pool() -> Iterator[WorkerPool]:
    with WorkerPool(1) as pool:
        yield pool


@pytest.fixture(scope="module")
def other_pool() -> Iterator[WorkerPool]:
    with WorkerPool(1) as pool:
        yield pool


@pytest.fixture(scope="module")
def pool_of_processes() -> Iterator[WorkerPool]:
    """Yield a pool that gives each run a process of its own."""
    with WorkerPool(1, one_process_per_run=True) as pool:
        yield pool


@pytest.fixture(scope="module")
def ordinary() -> Iterator[OrdinaryProcess]:
    with OrdinaryProcess(SETTINGS) as process:
        yield process


def outcome_of(pool: WorkerPool, source: str, world: World) -> Outcome:
    return pool.here().run(source, lambda: SimulatedRobot(world, SETTINGS))


def bound_names(source: str) -> set[str]:
    """Return the names that a program binds anywhere or declares global."""
    with warnings.catch_warnings(action="ignore"):
        nodes = list(ast.walk(ast.parse(source)))
    names = {node.id for node in nodes if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load)}
    for attribute in ("name", "arg", "asname", "rest"):
        names |= {str(getattr(node, attribute, None)).split(".")[0] for node in nodes}
    return names.union(*(node.names for node in nodes if isinstance(node, ast.Global)))


def assert_problems_are_true(source: str, problems: tuple[Flaw, ...], outcome: Outcome) -> None:
    """Fail if a problem that was found before the run contradicts the outcome.

    A name may be deleted, or bound only in a branch that does not run, and code in strings is not checked.
    The check must still find a name that is bound nowhere.
    """
    if outcome.error is None:
        assert not any(problem.line is None for problem in problems)
        return
    said = re.fullmatch(r"(?:cannot access free variable|name) '(\w+)' .*", outcome.error.message)
    if outcome.error.kind == "NameError" and said and outcome.line:
        message = f"the name {said[1]} is not defined"
        messages = {(flaw.line, flaw.message.partition(";")[0]) for flaw in problems}
        assert (outcome.line, message) in messages or said[1] in bound_names(source)


@pytest.mark.slow
def test_random_programs_have_one_outcome_isolated_or_not(
    pool: WorkerPool, other_pool: WorkerPool, ordinary: OrdinaryProcess
) -> None:
    seen: dict[tuple[str, World], Outcome] = {}

    @FUZZ
    @use_fixed_seed
    @given(programs(deep=False), st.sampled_from(WORLDS))
    @example("def task_program():\n    say(undefined_name)\n", WORLDS[0])
    @example(DEEP, WORLDS[0])
    @example(CLOSED_BY_AN_ERROR, WORLDS[0])
    @example(FAILED_WHILE_CLOSED, WORLDS[0])
    def check(source: str, world: World) -> None:
        note(source)
        outcome = seen[source, world] = outcome_of(pool, source, world)
        assert outcome.status is not Status.KILLED
        assert all_of(outcome_of(other_pool, source, world)) == all_of(outcome)
        assert without_addresses(ordinary.outcome(source, world)) == without_addresses(outcome)
        assert_problems_are_true(source, find_flaws(source), outcome)

    check()
    assert list(map(all_of, run(seen, workers=3, settings=SETTINGS))) == list(map(all_of, seen.values()))
    count = Counter(outcome.status for outcome in seen.values())
    assert count[Status.FINISHED] >= len(seen) / (3 if NIGHTLY else 5)  # twenty programs scatter widely
    for status in (Status.PYTHON_ERROR, Status.ROBOT_ERROR, Status.TIMEOUT):
        assert count[status] >= len(seen) // 60, count
    assert sum(map(len, (outcome.trace for outcome in seen.values()))) >= 2 * len(seen)


def test_deep_recursion_has_the_same_outcome_in_every_run(pool: WorkerPool, other_pool: WorkerPool) -> None:
    """Only isolated runs agree: the possible depth differs between interpreters."""

    @settings(FUZZ, max_examples=EXAMPLES // 4)
    @use_fixed_seed
    @given(programs(), st.sampled_from(WORLDS))
    def check(source: str, world: World) -> None:
        note(source)
        outcome = outcome_of(pool, source, world)
        assert outcome.status is not Status.KILLED
        assert all_of(outcome_of(other_pool, source, world)) == all_of(outcome)

    check()


@pytest.mark.slow
def test_broken_programs_have_the_same_outcome_in_every_run(pool: WorkerPool, other_pool: WorkerPool) -> None:
    @FUZZ
    @use_fixed_seed
    @given(broken_programs(), st.sampled_from(WORLDS))
    @example("def task_program():\n    \0\n", WORLDS[0])
    def check(source: str, world: World) -> None:
        note(source)
        outcome = outcome_of(pool, source, world)
        assert outcome.status is not Status.KILLED
        assert all_of(outcome_of(other_pool, source, world)) == all_of(outcome)
        problems = find_flaws(source)
        assert_problems_are_true(source, problems, outcome)
        if len(problems) == 1 and problems[0].kind in {"SyntaxError", "IndentationError", "TabError"}:
            assert outcome.trace == ()
            assert outcome.error is not None
            assert (outcome.error.kind, outcome.line) == (problems[0].kind, problems[0].line)

    check()


# --- programs that share a child

SIZE = 16  # programs of a batch
Batch = Sequence[tuple[str, Sequence[World]]]
Runs = dict[tuple[str, World], Outcome]


def find_differences(
    worker: Worker, batch: Batch, alone: Runs, settings: SimulationSettings
) -> Iterator[tuple[str, World, Outcome]]:
    """Yield the runs of a batch whose outcome differs from that alone."""
    jobs = [
        (source, [partial(SimulatedRobot, world, settings) for world in worlds]) for source, worlds in batch
    ]
    for (number, run_number), outcome in worker.run_tame(jobs).items():
        source, worlds = batch[number]
        if all_of(outcome) != all_of(alone[source, worlds[run_number]]):
            yield source, worlds[run_number], outcome


def assert_alike(worker: Worker, batch: Batch, alone: Runs, settings: SimulationSettings) -> None:
    """Fail with the fewest programs that show a difference, if there is one."""
    if not any(find_differences(worker, batch, alone, settings)):
        return
    fewest = list(batch)
    for program in batch:
        fewer = [each for each in fewest if each is not program]
        if any(find_differences(worker, fewer, alone, settings)):
            fewest = fewer
    for source, world, outcome in find_differences(worker, fewest, alone, settings):
        programs = "\n# --- and then\n".join(each for each, _ in fewest)
        pytest.fail(f"{programs}\n{world}\n{all_of(outcome)}\n{all_of(alone[source, world])}")
    pytest.fail("a difference comes and goes:\n" + "\n# --- and then\n".join(source for source, _ in batch))


def batches(random: Random, sources: Sequence[str], worlds: Sequence[World]) -> Iterator[Batch]:
    """Yield all programs in random batches, each with a few worlds, which may repeat."""
    waiting = random.sample(sources, len(sources))
    while waiting:
        size = random.randint(1, SIZE)
        yield [(source, random.choices(worlds, k=random.randint(1, 4))) for source in waiting[:size]]
        del waiting[:size]


@pytest.mark.slow
def test_random_programs_in_a_shared_child_have_the_same_outcomes_alone(
    pool: WorkerPool, pool_of_processes: WorkerPool
) -> None:
    drawn: dict[str, None] = {}

    @FUZZ
    @use_fixed_seed
    @given(tame_programs())
    @example(DEEP)
    def draw(source: str) -> None:
        drawn[source] = None

    draw()
    sources, random = list(drawn), Random(SEED)
    alone: Runs = {}
    jobs = [(source, [lambda: SimulatedRobot(WORLDS[0], SETTINGS)]) for source in sources]
    decided = sum(len(pool.here().run_tame(jobs[at : at + SIZE])) for at in range(0, len(jobs), SIZE))
    assert decided >= (0.6 if NIGHTLY else 0.4) * len(sources)
    for _ in range(2):
        for batch in batches(random, sources, WORLDS):
            for pair in ((source, world) for source, worlds in batch for world in worlds):
                if pair not in alone:
                    alone[pair] = outcome_of(pool_of_processes, *pair)
            assert_alike(pool.here(), batch, alone, SETTINGS)
    count = Counter(outcome.status for outcome in alone.values())
    assert count[Status.FINISHED] >= len(alone) / (4 if NIGHTLY else 8)
    for status in (Status.PYTHON_ERROR, Status.ROBOT_ERROR, Status.TIMEOUT):
        assert count[status] >= len(alone) // 60, count


@pytest.mark.slow
def test_real_programs_in_a_shared_child_have_the_same_outcomes_alone(
    pool: WorkerPool, pool_of_processes: WorkerPool, corpus: Path, paper: Suite
) -> None:
    lines = (corpus / "corpus" / "programs.jsonl").read_text(encoding="utf-8").splitlines()
    random, decided = Random(SEED), 0
    rows = [json.loads(line) for line in random.sample(lines, -(-len(lines) // 100))]
    whole: list[tuple[str, Sequence[World]]] = [
        (row["program"], [scenario.world for scenario in paper.tasks[row["task"]].scenarios]) for row in rows
    ]
    alone: Runs = {}
    worker = pool_of_processes.here()
    for source, worlds in whole:
        for world in worlds:
            alone[source, world] = worker.run(source, partial(SimulatedRobot, world, PAPER_SETTINGS))
        decided += len(pool.here().run_tame([(source, [lambda: SimulatedRobot(WORLDS[0])])]))
    assert decided >= len(whole) / 2
    assert_alike(pool.here(), whole[:SIZE], alone, PAPER_SETTINGS)
