"""Training tasks: right programs earn 1, others less, and no task of a benchmark is among them."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

import hacking
from codebotler.core.errors import UserError
from hacking import earned, hacks, honest, taken_back
from roboeval.suites.families.tasks import RETRACTION, family_names, trained_prompts, trained_task
from roboeval.suites.load import load_suite, shipped_suites
from roboeval.suites.solutions import solutions
from roboeval.suites.task import Task
from roboeval.training.prompts import load_prompts
from roboeval.training.rollouts import Rollout, judge

SEEDS = (0, 1, 1_000_000_000)
LONG = "WaitAndGreet"  # Its programs wait for a long time.
FAMILIES = [pytest.param(name, marks=[pytest.mark.slow] * (name == LONG)) for name in family_names()]
IDLE = ("", "def task_program():\n    pass\n")
ALIKE = 8  # Two instructions may not share so many words in a row.


def test_there_are_at_least_16_families() -> None:
    assert len(family_names()) >= 16


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(
    "seed", [SEEDS[0], *(pytest.param(seed, marks=pytest.mark.slow) for seed in SEEDS[1:])]
)
def test_right_programs_earn_1_idle_ones_0_and_wrong_ones_less_than_1(family: str, seed: int) -> None:
    task = trained_task(family, seed)
    programs = (task.solution, *IDLE, *(one.program for one in task.wrong))
    last = len(task.prompts) - 1
    assert last >= 3
    for prompt in (0, last) if seed == SEEDS[0] else range(last + 1):
        found = judge([Rollout(family, seed, prompt, program) for program in programs])
        right, nothing, idle, *wrong = (one.reward for one in found)
        assert (right, nothing, idle) == (1, 0, 0), prompt
        assert max(wrong) < 1, prompt


@pytest.mark.parametrize("family", family_names())
def test_a_seed_always_makes_the_same_task(family: str) -> None:
    task, again, other = trained_task(family, 5), trained_task(family, 5, worlds=8), trained_task(family, 6)
    assert task == again
    assert task.suite.digest != other.suite.digest
    assert task.prompts != other.prompts
    scenarios = task.suite.tasks[task.name].scenarios
    assert len(scenarios) >= 8
    assert not any("{" in prompt or "$" in prompt for prompt in task.prompts)


@pytest.mark.parametrize("family", family_names())
def test_prompts_without_a_task_are_those_of_the_task(family: str) -> None:
    assert trained_prompts(family, 77) == trained_task(family, 77).prompts


def test_the_number_of_worlds_can_be_chosen() -> None:
    task = trained_task("BringThing", 3, worlds=40)
    assert len(task.suite.tasks[task.name].scenarios) >= 40


OWN = """
about: Go to a room.
choose: {room: rooms, spare: rooms}
task:
  summary: Go to the $room.
  abilities: [navigation]
  prompts: [Go to the $room., Please go to the $room.]
  worlds: {robot: [start_loc, $spare], rooms: [$room, $spare, start_loc]}
  checks: {goes: {category: Location, rtl: 'tr.Exists(goto("$room"))'}}
  require: [goes]
solution: |
  def task_program():
      go_to("$room")
wrong:
  - about: goes elsewhere
    program: |
      def task_program():
          go_to("$spare")
"""


def test_a_users_own_family_is_a_file(tmp_path: Path) -> None:
    file = tmp_path / "Visit.yaml"
    file.write_text(OWN)
    (row, other) = load_prompts("test", count=2, only=[str(file)])
    assert row["prompt"] != other["prompt"]
    task = trained_task(row["family"], row["seed"])
    assert task.name == f"Visit-{row['seed']}"
    programs = [task.solution, task.wrong[0].program, ""]
    found = judge([Rollout(row["family"], row["seed"], row["prompt_index"], each) for each in programs])
    assert [one.reward for one in found] == [1, 0, 0]


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("spare: rooms", "spare: planets", r', line 3: unknown pool "planets"; use rooms, people'),
        ("tr.Exists(goto", "tr.Exist(goto", r", line 9: .*Exist"),
        ('go_to("$room")', 'go_to("$rom")', r', line 13: "\$rom" .*; write \$\$'),
        ("Go to the $room., Please", "Go for $ 5., Please", r", line 7: .*; write \$\$"),
        ("spare: rooms", "spare: 25 rooms", r", line 3: .*\b25\b"),
        ("spare: rooms", "spare: 4 to 2", r", line 3: .*\b10\b"),
        ("spare: rooms", "spare: 2 to 12", r", line 3: .*\b10\b"),
        ("spare: rooms", "spare: ['']", ", line 3: "),
        ("[Go to the $room.,", "['{Go|Drive to the $room.',", r", line 7: .*\{go\|drive\}"),
        ("  prompts: [Go to the $room., Please go to the $room.]\n", "", r", line 4: .*prompts"),
        ("summary: Go", "sumary: Go", r", line 5: .*sumary"),
    ],
)
def test_a_mistake_in_a_users_own_family_is_refused_with_its_line(
    tmp_path: Path, right: str, wrong: str, message: str
) -> None:
    file = tmp_path / "Visit.yaml"
    file.write_text(OWN.replace(right, wrong))
    with pytest.raises(UserError, match=rf"Visit\.yaml{message}"):
        trained_task(str(file), 1)


# --- no training on the benchmark


def shingles(text: str) -> set[tuple[str, ...]]:
    words = re.findall(r"[a-z']+", text.lower())
    return {tuple(words[at : at + ALIKE]) for at in range(len(words) - ALIKE + 1)}


def shape(program: str) -> str:
    """Dump the tree of a program without its texts and names."""
    tree = ast.parse(program)
    for node in ast.walk(tree):
        match node:
            case ast.Constant(str()):
                node.value = ""
            case ast.Name():
                node.id = "x"
    return ast.dump(tree)


@cache
def benchmark_tasks() -> list[Task]:
    return [task for suite in shipped_suites() for task in load_suite(suite).tasks.values()]


@cache
def benchmark_shingles() -> set[tuple[str, ...]]:
    return {words for task in benchmark_tasks() for prompt in task.prompts for words in shingles(prompt)}


@cache
def benchmark_shapes() -> set[str]:
    return {shape(one.program) for task in benchmark_tasks() for one in solutions(task) if one.fails is None}


@pytest.mark.parametrize("family", family_names())
def test_no_instruction_is_one_of_the_benchmark(family: str) -> None:
    asked = benchmark_shingles()
    for seed in SEEDS:
        for prompt in trained_task(family, seed).prompts:
            assert not shingles(prompt) & asked


@pytest.mark.parametrize("family", family_names())
def test_no_solution_is_one_of_the_benchmark(family: str) -> None:
    known = benchmark_shapes()
    assert known
    assert shape(trained_task(family, 0).solution) not in known


# --- programs that cheat


@pytest.mark.slow
def test_no_hack_earns_as_much_as_an_honest_program_without_its_last_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(hacking, "family_names", lambda: family_names()[::3])  # The benchmark takes all.
    programs = hacks()
    assert len(programs) >= 30
    aim = honest(SEEDS[:1])
    assert aim > 0.3
    assert {about: reward for about, reward in earned(programs, SEEDS[:1]).items() if reward >= aim} == {}


@pytest.mark.parametrize("family", FAMILIES)
def test_a_program_that_takes_back_its_report_does_not_pass(family: str) -> None:
    right = trained_task(family, 0).solution
    said, thanked = (taken_back(right, text) for text in (DENIALS[0], "Thank you, that is all."))
    denied, polite = judge([Rollout(family, 0, 0, said), Rollout(family, 0, 0, thanked)])
    assert denied.passed == 0
    assert denied.reward < 0.5  # Where nobody comes, the program waits and reports nothing.
    assert polite.passed == 1


DENIALS = [
    "None of that is true, forget it.",
    "Forget all that.",
    "Ignore what I said.",
    "That was a lie.",
    "It isn't true.",
    "Everything I said is wrong.",
    "Just kidding!",
    "I made that up.",
]
HONEST = [
    "None of them has one.",
    "Please don't forget it.",
    "Do not ignore this.",
    "It is in the wrong place.",
    "Nothing is missing.",
    "It is true.",
    "Do not forget what I said.",
]


def test_denials_take_a_report_back_and_honest_sentences_do_not() -> None:
    found = [text for text in (*DENIALS, *HONEST) if re.search(RETRACTION, text.lower())]
    assert found == DENIALS


# --- mistakes


@pytest.mark.parametrize("worlds", [0, -3, 20_000])
def test_a_number_of_worlds_outside_1_to_10000_is_refused(worlds: int) -> None:
    with pytest.raises(UserError, match=f"worlds is {worlds}, but it must be from 1 to 10,000"):
        trained_task("BringThing", 1, worlds=worlds)


@pytest.mark.parametrize("seed", [-1, 1.5, "x"])
def test_seeds_other_than_whole_numbers_from_0_are_refused(seed: int) -> None:
    with pytest.raises(UserError, match=r"the seed is .* whole number from 0"):
        trained_task("BringThing", seed)


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(UserError, match=r'unknown family "Fly"; .*AnnounceInOrder'):
        trained_task("Fly", 1)
