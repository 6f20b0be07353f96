"""How the programs that are recorded for a task, right and wrong ones, do in its worlds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

from codebotler.models.recorded import NAMES, Reply, lines_of_instructions, read_replies, recorded_model
from codebotler.simulator.engine import run
from roboeval.evaluation.failures import Verdict
from roboeval.evaluation.judge import judge
from roboeval.suites.load import Suite, Task

Verdicts: TypeAlias = Sequence[Verdict]
"""How one program did in all worlds of a task, or of its ablation."""


def tried(task: Task, suite: Suite, *, workers: int = 1) -> list[Verdicts]:
    """Run the recorded programs of a task in all its worlds, those of its ablation too.

    Args:
        task: the task.
        suite: by whose rules worlds are simulated.
        workers: how many programs are run at the same time.

    Returns:
        one entry a program, and one more a program where the task has an ablation.

    Raises:
        BadInput: a file of recorded programs is wrong.
        EngineError: no isolated process can be started.
    """
    judges = [worlds for worlds in (task.scenarios, task.ablation) if worlds]
    runs = [(program, worlds) for worlds in judges for program in recorded_programs(task)]
    pairs = ((program, scenario.world) for program, worlds in runs for scenario in worlds)
    outcomes = iter([*run(pairs, workers=workers, rules=suite.rules)])
    return [[judge(next(outcomes), scenario) for scenario in worlds] for _, worlds in runs]


def recorded_programs(task: Task) -> list[str]:
    """The programs that somebody wrote for the task's prompts, right and wrong ones.

    Args:
        task: the task.

    Raises:
        BadInput: a file of recorded programs is wrong.
    """
    return [reply.program for reply in recorded_replies(task)]


def recorded_replies(task: Task) -> list[Reply]:
    """What somebody wrote for the task's prompts; of replies with the same program the first.

    They stand in `recorded/*/TASK.yaml` of the suite's folder; where it has no such folder, or the task takes
    its instruction from a suite that ships, in the package.

    Args:
        task: the task.

    Raises:
        BadInput: a file of recorded programs is wrong.
    """
    written = [read_replies(path) for path in _recorded_files(task)]
    if task.borrows or not _recorded(task).is_dir():
        written += [recorded_model(name).replies for name in NAMES]
    replies = [reply for one in written for prompt in task.prompts for reply in one.get(prompt, ())]
    return [*{reply.program: reply for reply in reversed(replies)}.values()][::-1]


def unasked(task: Task) -> Iterator[tuple[str, Path, int | None]]:
    """Instructions that no prompt of the task is, so that nobody tries what was recorded for them.

    Args:
        task: the task; of one that takes its instruction from another suite none is told.

    Returns:
        for each the instruction, the file and the line in which it stands.

    Raises:
        BadInput: a file of recorded programs is wrong.
    """
    for path in [] if task.borrows else _recorded_files(task):
        for instruction, line in lines_of_instructions(path).items():
            if instruction not in task.prompts:
                yield instruction, path, line


def _recorded(task: Task) -> Path:
    return task.path.parents[1] / "recorded"


def _recorded_files(task: Task) -> list[Path]:
    return sorted(_recorded(task).glob(f"*/{task.path.name}"))
