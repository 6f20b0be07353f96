"""Measures, for several thresholds, how often a tool with candidates asks, and what its question gains.

The threshold in use was set with this: the highest one that asks at most half of the time. The programs are
those of the training families, of the suites `paper` and `rules`, and their mutants. Groups of ten are drawn
from two to six programs of a task, each right or wrong with equal chance, and with random frequencies. Tasks
for which completions of models were published are left out, since the result is measured with them.
GROUPS=1000 draws so many groups.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from random import Random
from statistics import fmean

from codebotler.candidates.clusters import cluster_candidates
from codebotler.candidates.question import DOMINANT_SHARE, question_about
from codebotler.checking.sampled import CheckSettings
from codebotler.simulator.engine import digest
from codebotler.simulator.pool import WorkerPool
from roboeval.evaluation.engines.engine import Local
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.mutation.mutants import Original, mutants, sample_mutants
from roboeval.mutation.operator import Context
from roboeval.suites.families.suite import FamilyTasks, family_suite
from roboeval.suites.load import Suite, load_suite
from roboeval.suites.solutions import solutions
from roboeval.suites.task import Task

GROUPS = int(os.environ.get("GROUPS", "400"))
WORKERS = int(os.environ.get("WORKERS", "2"))
MEASURED_TASKS = {"CountSavory", "GrilledCheese", "LunchTime", "SetTemperature"}
CANDIDATES, MUTANTS, MUTATED = 10, 24, 4
THRESHOLDS = (0.55, 0.65, 0.75, 0.85, 0.95)


@dataclass(frozen=True)
class TaskPrograms:
    """The right and the wrong programs of a task."""

    right: tuple[str, ...]
    wrong: tuple[str, ...]

    def draw_group(self, random: Random) -> tuple[str, ...]:
        """Draw candidates as from a model that understands a task in several ways."""
        some = [
            random.choice(self.right if random.random() < 1 / 2 else self.wrong)
            for _ in range(random.randint(2, 6))
        ]
        return tuple(random.choices(some, [random.gammavariate(1 / 2, 1) for _ in some], k=CANDIDATES))


def every_task() -> Iterator[tuple[Suite, Task, list[str]]]:
    """Yield each task with its own programs."""
    for seed in range(4):
        suite = family_suite(FamilyTasks("train", seed))
        for task in suite.tasks.values():
            recorded = [one for one in suite.recorded if one.instruction == task.prompts[0]]
            yield suite, task, [each.program for one in recorded for each in (*one.careful, *one.hasty)]
    for name in ("paper", "rules"):
        suite = load_suite(name)
        for task in suite.tasks.values():
            if task.name not in MEASURED_TASKS:
                yield suite, task, [one.program for one in solutions(task)]


def split(suite: Suite, task: Task, programs: list[str], pool: WorkerPool) -> TaskPrograms:
    """Judge programs of a task by its first prompt."""
    rows = (
        Completion(task=task.name, prompt=0, index=number, program=program)
        for number, program in enumerate(programs)
    )
    passed = [bool(row["passed"]) for row in evaluate(rows, suite, engine=Local(pool))]
    judged = list(zip(programs, passed, strict=True))
    return TaskPrograms(
        tuple(program for program, passes in judged if passes),
        tuple(program for program, passes in judged if not passes),
    )


def with_mutants(suite: Suite, task: Task, programs: list[str], pool: WorkerPool) -> TaskPrograms:
    """Return the programs of a task and mutants of the right ones."""
    own = list(dict.fromkeys(programs))
    originals = [Original("", program) for program in split(suite, task, own, pool).right[:MUTATED]]
    context = Context.of([one.world for one in task.scenarios], task.prompts)
    more = [one.program for one in sample_mutants(mutants(originals, context), MUTANTS, 1)]
    return split(suite, task, list(dict.fromkeys([*own, *more])), pool)


def offers(pool: WorkerPool, group: tuple[str, ...]) -> list[list[str]]:
    """Return, for each threshold, the program of the largest cluster, then those of the question."""
    clusters = cluster_candidates(pool.here(), group, CheckSettings())
    questions = [question_about(clusters, threshold) for threshold in THRESHOLDS]
    return [
        [clusters.clusters[0].program, *(() if one is None else (each.program for each in one.options))]
        for one in questions
    ]


def main() -> None:
    """Print pass@1 and the share of questions for each threshold."""
    random = Random("clarify")
    with WorkerPool(WORKERS) as pool:
        tasks = [with_mutants(*one, pool) for one in every_task()]
        usable = [one for one in tasks if one.right and one.wrong]
        drawn = [(task, task.draw_group(random)) for task in random.choices(usable, k=GROUPS)]
        call = partial(offers, pool)
        found = pool.map_distinct(
            lambda some: [*map(call, some)],
            [group for _, group in drawn],
            name=lambda group: digest(*group),
        )
        trials = [(set(task.right), group, each) for (task, group), each in zip(drawn, found, strict=True)]
    one = fmean(fmean(program in right for program in group) for right, group, _ in trials)
    majority = fmean(each[0][0] in right for right, _, each in trials)
    print(
        f"{len(usable)} tasks, {GROUPS} groups: one program {one:.3f}, most frequent behaviour {majority:.3f}"
    )
    for number, threshold in enumerate(THRESHOLDS):
        question = fmean(any(one in right for one in each[number]) for right, _, each in trials)
        asked = fmean(len(each[number]) > 1 for _, _, each in trials)
        mark = "  in use" if threshold == DOMINANT_SHARE else ""
        print(f"threshold {threshold:.2f}: with a question {question:.3f}, asked {asked:.0%}{mark}")


if __name__ == "__main__":
    main()
