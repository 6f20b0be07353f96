"""Reference solutions: right and wrong programs for a task, and mutants of them that are right as well.

They lie in `solutions/TASK.yaml` of the suite's folder.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from codebotler.badinput import YamlFile
from codebotler.models.recorded import NAMES, Recording, Solution
from codebotler.world import Name, Text
from roboeval.suites.load import Task

LENDER = Path(__file__).with_name("paper")
"""The suite from which others take instructions, and with them the solutions."""


class EquivalentMutantFile(BaseModel):
    """A mutant that does what was asked, as a file of solutions writes it.

    Args:
        operator: that made it.
        diff: what it changed, as `roboeval mutate` prints it.
        because: why it is right, in a sentence.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    operator: Name
    diff: Text
    because: Name


class SolutionsFile(BaseModel):
    """A file of solutions.

    Args:
        recorded: what the recorded models reply; only in the suites that ship.
        programs: right and wrong ones.
        equivalent_mutants: survivors that are right.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    recorded: tuple[Recording, ...] = ()
    programs: tuple[Solution, ...] = ()
    equivalent_mutants: tuple[EquivalentMutantFile, ...] = ()


def solutions(task: Task) -> tuple[Solution, ...]:
    """The solutions of a task, also those of the suite from which it takes its instruction.

    Args:
        task: the task.

    Raises:
        BadInput: a file of solutions is wrong.
    """
    folders = [task.path.parents[1], *([LENDER] if task.borrows else [])]
    distinct: dict[str, Solution] = {}
    for form in (_read(folder, task) for folder in folders):
        recorded = (one for model in NAMES for recording in form.recorded for one in recording.by(model))
        for solution in (*recorded, *form.programs):
            distinct.setdefault(solution.program, solution)
    return tuple(distinct.values())


def equivalent_mutants(task: Task) -> Mapping[tuple[str, str], str]:
    """Why a mutant of a task is right, by its operator and its diff.

    Args:
        task: the task.

    Raises:
        BadInput: the file of solutions is wrong.
    """
    listed = _read(task.path.parents[1], task).equivalent_mutants
    return {(one.operator, bare_diff(one.diff)): one.because.strip() for one in listed}


def bare_diff(diff: str) -> str:
    """A diff without the numbers of lines, which say nothing about right and wrong."""
    return "\n".join("@@" if line.startswith("@@") else line.rstrip() for line in diff.strip().splitlines())


def _read(folder: Path, task: Task) -> SolutionsFile:
    path = folder / "solutions" / task.path.name
    return YamlFile.read(path).validate(SolutionsFile) if path.exists() else SolutionsFile()
