"""Builds suites of generated tasks for the seeds of a split, such as `families-test-7`."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.words import counted, listed
from codebotler.models.recorded import InstructionSolutions, Solution
from roboeval.suites.families.tasks import GeneratedTask, family_names, suite_file, trained_task
from roboeval.suites.suite import Suite
from roboeval.suites.task import Task

SEEDS_PER_SPLIT = 1_000_000_000
FIRST_SEEDS = {"train": 0, "validation": SEEDS_PER_SPLIT, "test": 2 * SEEDS_PER_SPLIT}
"""The first seed of each split. A split has SEEDS_PER_SPLIT seeds."""

MAX_FAMILY_TASKS = 100
FAMILY_SUITE_NAME = re.compile(r"families-([a-z]+)-(\d{1,9})(?:-(\d{1,3}))?", re.ASCII)


def first_seed(split: str, seed: int, count: int, what: str) -> int:
    """Return the first seed of block number `seed` of a split, such as 30 for `train`, seed 3 and count 10.

    Blocks contain `count` seeds and do not overlap. Raises UserError if the split does not exist or a number
    is out of range. The message calls the counted items `what`, such as `task`.
    """
    if split not in FIRST_SEEDS:
        raise UserError(f'unknown split "{split}"; use {listed(list(FIRST_SEEDS))}')
    if count < 1:
        raise UserError(f"the number of {what}s is {count}, but it must be at least 1")
    if not 0 <= seed * count <= SEEDS_PER_SPLIT - count:
        most = SEEDS_PER_SPLIT // count - 1
        raise UserError(f"the seed is {seed}, but with {counted(count, what)} it must be from 0 to {most:,}")
    return FIRST_SEEDS[split] + seed * count


@dataclass(frozen=True)
class FamilyTasks:
    """Selects generated tasks for a suite, one from each family (task template) in turn.

    Args:
        split: `train`, `validation` or `test`, which have no task in common.
        seed: a number from 0; different seeds give different tasks.
        count: the number of tasks, 1 to 100; by default one per family.

    Raises:
        UserError: the split does not exist, or a number is out of range.
    """

    split: str
    seed: int = 0
    count: int = len(family_names())

    def __post_init__(self) -> None:
        if self.count > MAX_FAMILY_TASKS:
            raise UserError(f"the number of tasks is {self.count}, but it must be at most {MAX_FAMILY_TASKS}")
        first_seed(self.split, self.seed, self.count, "task")

    @property
    def name(self) -> str:
        """Return the name of the suite, such as `families-test-7`."""
        usual = self.count == len(family_names())
        return f"families-{self.split}-{self.seed}" + ("" if usual else f"-{self.count}")

    def seeds(self) -> Iterator[tuple[str, str, int]]:
        """Yield the name of each task (`BringThing`, then `BringThing-2`), its family and its seed."""
        first = first_seed(self.split, self.seed, self.count, "task")
        families, numbers = family_names(), Counter[str]()
        for seed in range(first, first + self.count):
            family = families[seed % len(families)]
            numbers[family] += 1
            nth = numbers[family]
            yield (family if nth == 1 else f"{family}-{nth}"), family, seed


def family_tasks_named(name: str) -> FamilyTasks | None:
    """Parse a name such as `families-test-7`, or return None for other names. Raise UserError if invalid."""
    match = FAMILY_SUITE_NAME.fullmatch(name)
    if match is None:
        return None
    split, seed, count = match.groups()
    found = FamilyTasks(split, int(seed), *([] if count is None else [int(count)]))
    return found if found.name == name else None


@lru_cache(maxsize=8)
def family_suite(which: FamilyTasks, skills: SkillTable = SKILLS) -> Suite:
    """Build the suite of generated tasks that `which` describes. Equal arguments give equal suites."""
    head = suite_file()
    made = {name: trained_task(family, seed) for name, family, seed in sorted(which.seeds())}
    digests = [f"{name} {one.suite.digest}" for name, one in made.items()]
    return Suite(
        name=which.name,
        version=head.version,
        about=f"{counted(which.count, 'task')} of families: split {which.split}, seed {which.seed}",
        settings=head.rules.settings(),
        tasks={name: _named(name, one) for name, one in made.items()},
        digest=hashlib.sha256("\n".join([str(head.version), *digests]).encode()).hexdigest(),
        skills=skills,
        is_generated=True,
        recorded=tuple(solutions for one in made.values() for solutions in _recorded(one)),
    )


def _named(name: str, made: GeneratedTask) -> Task:
    """Return a task with its name in the suite and the path of its family's file."""
    task = made.suite.tasks[made.name]
    return replace(task, name=name, path=task.path.with_name(f"{name.partition('-')[0]}.yaml"))


def _recorded(made: GeneratedTask) -> Iterator[InstructionSolutions]:
    """Yield the programs of recorded models. Careful models are right, hasty ones may be wrong at first."""
    right = Solution(about="right", program=made.solution)
    wrong = [Solution(about=one.about, program=one.program, fails="unknown") for one in made.wrong]
    mixed = (right, *wrong)
    for number, prompt in enumerate(made.prompts):
        at = number % len(mixed)
        yield InstructionSolutions(instruction=prompt, careful=(right,), hasty=mixed[at:] + mixed[:at])
