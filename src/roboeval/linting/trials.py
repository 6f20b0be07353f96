"""Judges the reference solutions of a task in its worlds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from codebotler.core.trace import Outcome
from codebotler.simulator.pool import WorkerPool
from roboeval.evaluation.judging.failures import Verdict
from roboeval.evaluation.judging.judge import judge, run_in
from roboeval.suites.load import Scenario, Suite, Task
from roboeval.suites.solutions import solutions

Verdicts: TypeAlias = Sequence[Verdict]  # verdicts on a program in all worlds of a task or of its ablation


def judge_solutions(task: Task, suite: Suite, *, workers: int = 1) -> list[Verdicts]:
    """Judge a task's solutions by all requirements, first in its worlds, then in those of its ablation."""
    judges = [worlds for worlds in (task.scenarios, task.ablation) if worlds]
    runs = [(solution.program, worlds) for worlds in judges for solution in solutions(task)]
    with WorkerPool(workers) as pool:

        def outcomes(program: str, worlds: Sequence[Scenario]) -> list[Outcome]:
            return run_in(pool.here(), [program], worlds, suite)[0]

        ran = [pool.submit(outcomes, *each) for each in runs]
        return [
            [judge(outcome, scenario) for outcome, scenario in zip(one.result(), worlds, strict=True)]
            for one, (_, worlds) in zip(ran, runs, strict=True)
        ]
