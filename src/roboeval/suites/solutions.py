"""Reads `solutions/TASK.yaml`: correct and incorrect programs, and equivalent mutants."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from pathlib import Path

from codebotler.core.world_file import Name, YamlText
from codebotler.core.yaml_files import YamlFile
from codebotler.models.recorded import RECORDED_NAMES, InstructionSolutions, Solution
from roboeval.suites.load import Task
from roboeval.suites.schema import StrictForm

LENDING_SUITE = Path(__file__).with_name("paper")  # the suite whose instructions other suites borrow


class EquivalentMutantFile(StrictForm):
    """A mutant (changed program) that behaves differently from its original but is still right."""

    operator: Name
    diff: YamlText  # the diff that `roboeval mutate` prints
    because: Name


class SolutionsFile(StrictForm):
    """The content of a solutions file: programs, replies of recorded models, and equivalent mutants."""

    recorded: tuple[InstructionSolutions, ...] = ()  # replies of the recorded models
    programs: tuple[Solution, ...] = ()
    equivalent_mutants: tuple[EquivalentMutantFile, ...] = ()


def solutions(task: Task) -> tuple[Solution, ...]:
    """Return the distinct solutions of a task, with those in the suite `paper` if it lent the prompts."""
    folders = [task.path.parents[1], *([LENDING_SUITE] if task.borrows else [])]
    distinct: dict[str, Solution] = {}
    for form in (_read(folder, task) for folder in folders):
        replies = (each.replies_of(model) for model in RECORDED_NAMES for each in form.recorded)
        for solution in chain(*replies, form.programs):
            distinct.setdefault(solution.program, solution)
    return tuple(distinct.values())


def locate_solution(task: Task, solution: Solution) -> tuple[Path, int | None]:
    """Return a solution's file and line, or line 1 of the task file if it is not listed in `programs`."""
    path = task.path.parents[1] / "solutions" / task.path.name
    programs = _read(task.path.parents[1], task).programs
    if solution not in programs:
        return task.path, 1
    return path, YamlFile.read(path).line(("programs", programs.index(solution)))


def equivalent_mutants(task: Task) -> Mapping[tuple[str, str], str]:
    """Return why some mutants (changed programs) of a task are still right, by (operator, `bare_diff`)."""
    listed = _read(task.path.parents[1], task).equivalent_mutants
    return {(one.operator, bare_diff(one.diff)): one.because.strip() for one in listed}


def bare_diff(diff: str) -> str:
    """Remove line numbers from a diff, so that it stays the same when lines of the program move."""
    return "\n".join("@@" if line.startswith("@@") else line.rstrip() for line in diff.strip().splitlines())


def _read(folder: Path, task: Task) -> SolutionsFile:
    path = folder / "solutions" / task.path.name
    return YamlFile.read(path).validate(SolutionsFile) if path.exists() else SolutionsFile()
