"""How the reference solutions of a task do in its worlds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from codebotler.simulator.engine import run
from roboeval.evaluation.failures import Verdict
from roboeval.evaluation.judge import judge
from roboeval.suites.load import Suite, Task
from roboeval.suites.solutions import solutions

Verdicts: TypeAlias = Sequence[Verdict]  # on one program in all worlds of a task, or of its ablation


def tried(task: Task, suite: Suite, *, workers: int = 1) -> list[Verdicts]:
    """Run the solutions of a task in its worlds, and after all of them once more in those of its ablation.

    The verdicts are by all requirements, also by those that only some prompts ask for.
    """
    judges = [worlds for worlds in (task.scenarios, task.ablation) if worlds]
    runs = [(solution.program, worlds) for worlds in judges for solution in solutions(task)]
    pairs = ((program, scenario.world) for program, worlds in runs for scenario in worlds)
    outcomes = iter([*run(pairs, workers=workers, rules=suite.rules)])
    return [[judge(next(outcomes), scenario) for scenario in worlds] for _, worlds in runs]
