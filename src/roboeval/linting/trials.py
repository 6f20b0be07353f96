"""How the reference solutions of a task do in its worlds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from codebotler.simulator.engine import run
from roboeval.evaluation.failures import Verdict
from roboeval.evaluation.judge import judge
from roboeval.suites.load import Suite, Task
from roboeval.suites.solutions import solutions

Verdicts: TypeAlias = Sequence[Verdict]
"""How one program did in all worlds of a task, or of its ablation."""


def tried(task: Task, suite: Suite, *, workers: int = 1) -> list[Verdicts]:
    """Run the solutions of a task in all its worlds, those of its ablation too.

    Args:
        task: the task.
        suite: by whose rules worlds are simulated.
        workers: how many programs are run at the same time.

    Returns:
        one entry a solution, and one more a solution where the task has an ablation.

    Raises:
        BadInput: a file of solutions is wrong.
        EngineError: no isolated process can be started.
    """
    judges = [worlds for worlds in (task.scenarios, task.ablation) if worlds]
    runs = [(solution.program, worlds) for worlds in judges for solution in solutions(task)]
    pairs = ((program, scenario.world) for program, worlds in runs for scenario in worlds)
    outcomes = iter([*run(pairs, workers=workers, rules=suite.rules)])
    return [[judge(next(outcomes), scenario) for scenario in worlds] for _, worlds in runs]
