"""Results of mutants: killed by a check or an error, survived, equivalent, unchanged, or crashed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from codebotler.core.trace import Outcome
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.worlds.robot import SimulatedRobot
from roboeval.mutation.mutants import Mutant, Original
from roboeval.mutation.report import to_yaml
from roboeval.mutation.score import MutantResult, MutantStatus, MutationScore, TriedMutant
from roboeval.mutation.trials import judge_mutant, mutation_score, mutation_worlds
from roboeval.suites.load import Suite, Task, load_suite
from roboeval.suites.solutions import equivalent_mutants
from small_suite import write_suite

TASK = """\
name: T
summary: Visit the kitchen, and say bye where somebody is.
prompts: [p]
checks:
  goes: {category: Location, rtl: 'tr.Exists(goto("kitchen"))'}
  says: {category: SayAtLocation, rtl: 'tr.Exists(say("bye"))'}
worlds:
  - about: nobody is in
    robot: hall
    rooms: [hall, kitchen]
    require: [goes, not says]
  - about: ann is in
    robot: hall
    rooms: [hall, kitchen]
    people: {kitchen: [{name: ann, answers: ["yes"]}]}
    require: [goes, says]
"""
KILLED, SURVIVED, EQUIVALENT, SAME, CRASHES = MutantStatus
NOT_SAYS = MutantResult(KILLED, "nobody is in", "not says")
RIGHT = Original(
    "right", "def task_program():\n    go_to('kitchen')\n    if is_in_room('ann'):\n        say('bye')\n"
)


@pytest.fixture(scope="module")
def pool() -> Iterator[WorkerPool]:
    with WorkerPool(1) as pool:
        yield pool


@pytest.fixture
def suite(tmp_path: Path) -> Suite:
    return load_suite(write_suite(tmp_path, TASK))


@pytest.fixture
def task(suite: Suite) -> Task:
    return suite.task("T")


def program(body: str) -> str:
    return "def task_program():\n" + "".join(f"    {line}\n" for line in body.split("; "))


def outcomes_of(source: str, suite: Suite, pool: WorkerPool) -> list[Outcome]:
    robots = [partial(SimulatedRobot, one.world, suite.settings) for one in suite.task("T").scenarios]
    return pool.here().run_all([(source, robots)])[0]


@pytest.mark.parametrize(
    ("body", "result"),
    [
        ("say('bye')", MutantResult(KILLED, "nobody is in", "goes")),
        ("go_to('kitchen')", MutantResult(KILLED, "ann is in", "says")),
        ("go_to('attic')", MutantResult(KILLED, "nobody is in", "GoToInvalidLocation")),
        ("go_to('kitchen'); ask('ann', 'Hm?', ['yes'])", MutantResult(KILLED, "nobody is in", "AskNoPerson")),
        ("go_to('kitchen'); while True: pass", MutantResult(KILLED, "nobody is in", "TimeoutError")),
        (
            "go_to('kitchen'); [1][is_in_room('x')]; say('bye')",
            MutantResult(KILLED, "nobody is in", "not says"),
        ),
        ("go_to('kitchen'); [1][is_in_room('x')]", MutantResult(KILLED, "ann is in", "IndexError")),
        ("go_to('kitchen'); say(1)", MutantResult(CRASHES, "nobody is in", "TypeError")),
        ("go_to('kitchen'); [say('bye') for _ in [1] if is_in_room('ann')]", MutantResult(SAME)),
        ("go_to('kitchen'); say('hi'); [say('bye') for _ in [1] if is_in_room('x')]", MutantResult(SURVIVED)),
    ],
)
def test_the_result_of_a_mutant(body: str, result: MutantResult, suite: Suite, pool: WorkerPool) -> None:
    before, now = (outcomes_of(source, suite, pool) for source in (RIGHT.program, program(body)))
    assert judge_mutant(now, before, suite.task("T").scenarios) == result


def test_a_wrong_original_names_its_world_and_reason(suite: Suite, task: Task, pool: WorkerPool) -> None:
    wrong = Original("wrong", program("go_to('kitchen')")), Original("broken", "def (")
    score = mutation_score(task, suite, pool, further=[RIGHT, *wrong])
    assert score.right == (RIGHT,)
    assert score.wrong == (
        (wrong[0], MutantResult(KILLED, "ann is in", "says")),
        (wrong[1], MutantResult(KILLED, "nobody is in", "SyntaxError")),
    )


def test_mutants_are_judged_by_all_prompts_that_their_original_passes(
    tmp_path: Path, pool: WorkerPool
) -> None:
    asks_twice = (
        TASK.replace("[p]", "[p, p twice, p thrice]")
        .replace("says: {", "twice: {category: Location, rtl: 'tr.AtLeast(goto(\"kitchen\"), 2)'}\n  says: {")
        .replace("thrice", "thrice and bye", 1)
        .replace(
            "[goes,", "[goes, {check: twice, prompts: {1: twice}}, {check: says, prompts: {2: and bye}},"
        )
        .replace("not says]", "{check: not says, prompts: {0: p}}]")
    )
    suite = load_suite(write_suite(tmp_path, asks_twice))
    twice = Original(
        "twice", RIGHT.program.replace("    if is", "    go_to('hall')\n    go_to('kitchen')\n    if is")
    )
    score = mutation_score(suite.task("T"), suite, pool, further=[RIGHT, twice])
    assert score.right == (RIGHT, twice)
    why = {one.result.why for one in score.mutants if one.mutant.original == twice}
    assert why >= {"twice", "not says"}
    assert "twice" not in {one.result.why for one in score.mutants if one.mutant.original == RIGHT}


# --- the score


def score_of(*statuses: MutantStatus) -> MutationScore:
    made = (Mutant("drop-the-look", RIGHT, program(f"say({n})")) for n in range(len(statuses)))
    tried = tuple(TriedMutant(one, MutantResult(status)) for one, status in zip(made, statuses, strict=True))
    return MutationScore("T", 2, (RIGHT,), (), tried)


def test_the_score_is_the_share_of_wrong_mutants_that_are_killed() -> None:
    score = score_of(*[KILLED] * 6, *[SURVIVED] * 2, *[EQUIVALENT] * 2, SAME, CRASHES)
    assert (score.score, score.score_of_all) == (6 / 8, 6 / 10)
    assert len(score.survivors) == 2
    assert score_of(SAME).score is None


def test_few_mutants_or_many_equivalent_ones_cause_a_warning() -> None:
    assert score_of(*[KILLED] * 60).warnings == ()
    (few,) = score_of(*[KILLED] * 59, SAME).warnings
    assert re.match(r"T: .*\b59 mutants\b", few)
    assert score_of(*[KILLED] * 51, *[EQUIVALENT] * 9).warnings == ()
    (many,) = score_of(*[KILLED] * 50, *[EQUIVALENT] * 10).warnings
    assert re.match(r"T: 10 of 60 mutants\b.*\b15%", many)


# --- equivalent mutants


def yaml_with_reasons(*mutants: Mutant) -> str:
    return to_yaml(mutants).replace("because: ''", "because: It does no harm.")


def test_a_survivor_on_the_list_is_equivalent(suite: Suite, task: Task, pool: WorkerPool) -> None:
    before = mutation_score(task, suite, pool, further=[RIGHT])
    survivor, *_ = before.survivors
    killed = next(one.mutant for one in before.mutants if one.result.status is KILLED)
    other = replace(survivor, operator="and-or")
    path = task.path.parents[1] / "solutions" / "T.yaml"
    path.parent.mkdir()
    for listed, equivalent in (
        (yaml_with_reasons(survivor, killed), 1),
        (yaml_with_reasons(survivor).replace("-1,", "-9,"), 1),
        (yaml_with_reasons(other), 0),
    ):
        path.write_text(listed)
        found = mutation_score(task, suite, pool, further=[RIGHT])
        results = {one.mutant: one.result for one in found.mutants}
        assert found.count(EQUIVALENT) == equivalent
        assert results[killed].status is KILLED
        assert results[survivor] == (
            MutantResult(EQUIVALENT, why="It does no harm.") if equivalent else MutantResult(SURVIVED)
        )


@pytest.mark.parametrize(
    ("text", "line", "named"),
    [
        (to_yaml([Mutant("detour", RIGHT, program("go_to('kitchen')"))]), 9, '"because" is ""'),
        ("equivalent_mutants: [{operator: x, diff: y, because: z, why: w}]", 1, '"why"'),
    ],
    ids=["without a reason", "unknown key"],
)
def test_a_wrong_list_of_equivalent_mutants_is_refused(task: Task, text: str, line: int, named: str) -> None:
    path = task.path.parents[1] / "solutions" / "T.yaml"
    path.parent.mkdir()
    path.write_text(text)
    with pytest.raises(UserError, match=named) as error:
        equivalent_mutants(task)
    assert (error.value.file, error.value.line) == (path, line)


# --- worlds


def test_worlds_written_by_hand_cannot_be_sampled(suite: Suite, task: Task) -> None:
    assert mutation_worlds(suite, task, None, 1) == task.scenarios
    with pytest.raises(UserError, match=r'"mine".* --worlds'):
        mutation_worlds(suite, task, 200, 1)


def test_mutants_run_in_other_worlds_than_evaluations(
    suite: Suite, task: Task, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[tuple[int, int]] = []

    def with_worlds(suite: Suite, count: int, seed: int) -> Suite:
        drawn.append((count, seed))
        return suite

    monkeypatch.setattr(Suite, "with_worlds", with_worlds)
    makes = replace(suite, worlds=30, seed=3)
    assert mutation_worlds(makes, task, 3, 1) == task.scenarios
    assert [mutation_worlds(makes, task, None, seed) for seed in range(5)] == [task.scenarios] * 5
    assert [count for count, _ in drawn] == [3, *[200] * 5]
    seeds = [seed for _, seed in drawn[1:]]
    assert 3 not in seeds
    assert len(set(seeds)) == 5
