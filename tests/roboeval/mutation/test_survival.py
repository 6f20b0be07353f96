"""What becomes of a mutant: killed by a check or an error, alive, the same as before, or no robot program."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from codebotler.badinput import BadInput
from codebotler.simulator.engine import Lanes
from roboeval.mutation.mutants import Mutant, Original
from roboeval.mutation.scores import Score, Trial, explained
from roboeval.mutation.stillright import to_yaml
from roboeval.mutation.survival import Baseline, End, Fate, baselines, ends
from roboeval.mutation.worlds import worlds_of
from roboeval.suites.load import Scenario, Suite, Task, load_suite
from roboeval.suites.solutions import equivalent_mutants
from small_suite import a_suite

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
RIGHT = Original(
    "right", "def task_program():\n    go_to('kitchen')\n    if is_in_room('ann'):\n        say('bye')\n"
)


@pytest.fixture(scope="module")
def lanes() -> Iterator[Lanes]:
    with Lanes(1) as lanes:
        yield lanes


@pytest.fixture
def suite(tmp_path: Path) -> Suite:
    return load_suite(a_suite(tmp_path, TASK))


@pytest.fixture
def task(suite: Suite) -> Task:
    return suite.task("T")


def mutant(body: str, operator: str = "drop-the-look") -> Mutant:
    return Mutant(
        operator, RIGHT, "def task_program():\n" + "".join(f"    {line}\n" for line in body.split("; "))
    )


def end_of(body: str, suite: Suite, lanes: Lanes) -> End:
    scenarios = suite.task("T").scenarios
    (before,) = baselines([RIGHT], scenarios, suite.rules, lanes)
    assert before.fault is None
    (end,) = ends([mutant(body)], [before], scenarios, suite.rules, lanes)
    return end


@pytest.mark.parametrize(
    ("body", "end"),
    [
        ("say('bye')", End(Fate.KILLED, "nobody is in", "goes")),
        ("go_to('kitchen')", End(Fate.KILLED, "ann is in", "says")),
        ("go_to('attic')", End(Fate.KILLED, "nobody is in", "GoToInvalidLocation")),
        ("go_to('kitchen'); ask('ann', 'Hm?', ['yes'])", End(Fate.KILLED, "nobody is in", "AskNoPerson")),
        ("go_to('kitchen'); while True: pass", End(Fate.KILLED, "nobody is in", "TimeoutError")),
        ("go_to('kitchen'); [1][is_in_room('x')]; say('bye')", End(Fate.KILLED, "nobody is in", "not says")),
        ("go_to('kitchen'); [1][is_in_room('x')]", End(Fate.KILLED, "ann is in", "IndexError")),
        ("go_to('kitchen'); say(1)", End(Fate.CRASHES, "nobody is in", "TypeError")),
        ("go_to('kitchen'); [say('bye') for _ in [1] if is_in_room('ann')]", End(Fate.SAME)),
        ("go_to('kitchen'); say('hi'); [say('bye') for _ in [1] if is_in_room('x')]", End(Fate.SURVIVED)),
    ],
)
def test_what_becomes_of_a_mutant(body: str, end: End, suite: Suite, lanes: Lanes) -> None:
    assert end_of(body, suite, lanes) == end


def test_an_original_that_is_wrong_says_where(suite: Suite, task: Task, lanes: Lanes) -> None:
    originals = [
        RIGHT,
        Original("wrong", "def task_program():\n    go_to('kitchen')\n"),
        Original("broken", "def ("),
    ]
    found = list(baselines(originals, task.scenarios, suite.rules, lanes))
    assert [one.fault for one in found] == [
        None,
        End(Fate.KILLED, "ann is in", "says"),
        End(Fate.KILLED, "nobody is in", "SyntaxError"),
    ]


# --- the score


def score(*fates: Fate) -> Score:
    trials = tuple(Trial(mutant(f"say({n})"), End(fate)) for n, fate in enumerate(fates))
    return Score("T", 2, (RIGHT,), (), trials)


def test_the_score_is_the_share_of_wrong_mutants_that_are_killed() -> None:
    fates = [Fate.KILLED] * 6 + [Fate.SURVIVED] * 2 + [Fate.STILL_RIGHT] * 2 + [Fate.SAME, Fate.CRASHES]
    assert score(*fates).score == 6 / 8
    assert score(*fates).score_of_all == 6 / 10
    assert len(score(*fates).survivors) == 2
    assert score(Fate.SAME).score is None


def test_what_makes_a_score_doubtful() -> None:
    assert score(*[Fate.KILLED] * 60).complaints == ()
    (few,) = score(*[Fate.KILLED] * 59, Fate.SAME).complaints
    assert re.match(r"T: .*\b59 mutants\b", few)
    assert score(*[Fate.KILLED] * 51, *[Fate.STILL_RIGHT] * 9).complaints == ()
    (many,) = score(*[Fate.KILLED] * 50, *[Fate.STILL_RIGHT] * 10).complaints
    assert re.match(r"T: 10 of 60 mutants\b.*\b15%", many)


# --- the list of those that are still right

GREETS = mutant("go_to('kitchen'); say('hi'); if is_in_room('ann'): say('bye')", "swap-steps")


def a_list(task: Task, text: str) -> None:
    path = task.path.parents[1] / "solutions" / "T.yaml"
    path.parent.mkdir()
    path.write_text(text)


def test_a_survivor_on_the_list_is_still_right(task: Task) -> None:
    a_list(task, FILLED)
    trials = [Trial(GREETS, End(Fate.SURVIVED)), Trial(mutant("say('x')"), End(Fate.SURVIVED))]
    first, second = explained(trials, equivalent_mutants(task))
    assert first.end == End(Fate.STILL_RIGHT, why="It does no harm.")
    assert second.end.fate is Fate.SURVIVED


def test_a_mutant_on_the_list_that_is_killed_stays_killed(task: Task) -> None:
    a_list(task, FILLED)
    (trial,) = explained([Trial(GREETS, End(Fate.KILLED, "w", "says"))], equivalent_mutants(task))
    assert trial.end.fate is Fate.KILLED


def test_a_mutant_is_known_by_its_operator_and_its_diff(task: Task) -> None:
    a_list(task, FILLED.replace("-1,4", "-9,4"))
    other = Mutant("negate-a-condition", GREETS.original, GREETS.program)
    trials = [Trial(one, End(Fate.SURVIVED)) for one in (GREETS, other)]
    found = explained(trials, equivalent_mutants(task))
    assert [trial.end.fate for trial in found] == [Fate.STILL_RIGHT, Fate.SURVIVED]


FILLED = to_yaml([GREETS]).replace("because: ''", "because: It does no harm.")


@pytest.mark.parametrize(
    ("text", "line", "named"),
    [
        (to_yaml([GREETS]), 11, '"because" is empty'),
        ("equivalent_mutants: [{operator: x, diff: y, because: z, why: w}]", 1, '"why"'),
    ],
    ids=["without a reason", "unknown key"],
)
def test_a_list_that_is_wrong(task: Task, text: str, line: int, named: str) -> None:
    a_list(task, text)
    with pytest.raises(BadInput, match=named) as error:
        equivalent_mutants(task)
    assert (error.value.file, error.value.line) == (task.path.parents[1] / "solutions" / "T.yaml", line)


# --- worlds


def test_worlds_that_are_written_out(suite: Suite, task: Task) -> None:
    assert worlds_of(suite, task, None, 1) == task.scenarios
    with pytest.raises(BadInput, match=r'"mine".* written out'):
        worlds_of(suite, task, 200, 1)


def test_worlds_that_a_suite_makes_for_mutants_are_not_those_it_judges_by(suite: Suite, task: Task) -> None:
    seeds: list[int] = []

    def further(task: Task, count: int, seed: int) -> tuple[Scenario, ...]:
        seeds.append(seed)
        return (task.scenarios * count)[:count]

    makes = replace(suite, further=further, seed=3)
    assert worlds_of(makes, task, 3, 1) == (*task.scenarios, *task.scenarios)[:3]
    assert [len(worlds_of(makes, task, None, seed)) for seed in range(5)] == [200] * 5
    assert 3 not in seeds
    assert len(set(seeds)) == 5


def test_a_baseline_keeps_what_its_original_did(suite: Suite, task: Task, lanes: Lanes) -> None:
    (found,) = baselines([RIGHT], task.scenarios, suite.rules, lanes)
    assert isinstance(found, Baseline)
    assert [len(outcome.trace) for outcome in found.outcomes] == [2, 3]
