"""Suites: tasks and the rules by which they are judged."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from os import PathLike
from pathlib import Path
from typing import TypeAlias

from codebotler.arguments import expect_skills, expect_text, expect_whole
from codebotler.badinput import BadInput, YamlFile
from codebotler.english import counted
from codebotler.simulator.rules import Rules
from codebotler.skills import SKILLS, SkillTable
from roboeval.suites.installed import installed_folder, installed_suites
from roboeval.suites.schema import MOST_WORLDS, SuiteFile
from roboeval.suites.task import Accepted, Check, Fact, Requirement, Scenario, Task
from roboeval.suites.taskfile import Lot, read_task

__all__ = [
    "ABLATED",
    "SUITES",
    "Accepted",
    "Check",
    "Fact",
    "Requirement",
    "Scenario",
    "Suite",
    "Task",
    "load_suite",
    "read_task",
    "shipped_suites",
]

ABLATED = "-ablation"  # at the end of the name of an evaluation's files, and so of no suite's
SUITES = Path(__file__).parent
SUITE_NAME = re.compile(r"[a-z][a-z0-9-]*")


Further: TypeAlias = Callable[[Task, int, int], tuple[Scenario, ...]]
"""Makes so many worlds of a task with what they require, from a seed; the same seed makes the same ones."""


def expect_suite(given: object) -> None:
    """Refuse what is no suite, such as the name of one.

    Args:
        given: what was given.

    Raises:
        BadInput: it is none.
    """
    if not isinstance(given, Suite):
        raise BadInput(f"the suite is {given!r}, but it must be one that load_suite has read")


@dataclass(frozen=True)
class Suite:
    """Tasks and the rules by which they are judged.

    Args:
        name: as evaluations call it.
        version: counted up when a verdict may change.
        about: what it is, in a sentence.
        rules: how worlds are simulated.
        tasks: by name, sorted.
        digest: a hash of all that verdicts and prompts depend on.
        further: makes worlds that no file writes out; None where all worlds are written out.
        folder: where it was read from.
        worlds: how many worlds a task has at least, where they are drawn; None if they are written by hand.
        seed: from which they are drawn.
        skills: what can stand in its formulas.
    """

    name: str
    version: int
    about: str
    rules: Rules
    tasks: Mapping[str, Task]
    digest: str
    further: Further | None = field(default=None, compare=False)  # follows from the rest
    folder: Path | None = None
    worlds: int | None = None
    seed: int | None = None
    skills: SkillTable = SKILLS

    def __hash__(self) -> int:
        return hash(self.digest)  # tasks lie in a dictionary, which has no hash

    def __repr__(self) -> str:
        return f"Suite({self.name!r}, {counted(len(self.tasks), 'task')})"

    def with_worlds(self, count: int | None = None, seed: int | None = None) -> Suite:
        """The same suite with other worlds, drawn from the same descriptions.

        Args:
            count: how many a task, 1 to 10,000; as many as now by default.
            seed: from which to draw them; the same as now by default.

        Raises:
            BadInput: its worlds are written by hand, or a number is none or out of its range.
        """
        if self.worlds is None or self.folder is None:
            raise BadInput(f'the worlds of the suite "{self.name}" are written by hand; it has no others')
        if count is not None:
            expect_whole(count, "the number of worlds", least=1, most=MOST_WORLDS)
        if seed is not None:
            expect_whole(seed, "the seed")
        seed = self.seed if seed is None else seed
        return _read_suite(self.folder, self.skills, count or self.worlds, seed)

    def with_own_worlds(self) -> Suite:
        """The same suite as it is read where nobody asks for other worlds."""
        if self.worlds is None or self.folder is None:
            return self
        return _read_suite(self.folder, self.skills)

    def task(self, name: str) -> Task:
        """A task by name.

        Raises:
            BadInput: there is none.
        """
        if name not in self.tasks:
            raise BadInput(
                f'the suite "{self.name}" has no task "{name}"; its tasks are {", ".join(self.tasks)}'
            )
        return self.tasks[name]


def shipped_suites() -> tuple[str, ...]:
    """The names of the suites that ship with RoboEval."""
    return tuple(sorted(path.parent.name for path in SUITES.glob("*/suite.yaml")))


def load_suite(name: str | PathLike[str] = "paper", *, skills: SkillTable = SKILLS) -> Suite:
    """Read a suite.

    Args:
        name: of a suite that ships with RoboEval, or that an installed package brings, or its folder.
        skills: what can stand in formulas.

    Raises:
        BadInput: there is no such suite, or one of its files is wrong.
    """
    name = str(name) if isinstance(name, PathLike) else name
    expect_text(name, "the suite's name")
    expect_skills(skills)
    folder = suite_folder(name)
    suite = _read_suite(folder, skills)
    if suite.name != name and not (Path(name) / "suite.yaml").is_file():
        sentence = f'the suite is named "{suite.name}", but its package calls it "{name}"; name both alike'
        raise YamlFile.read(folder / "suite.yaml").wrong(sentence, "name")
    return suite


def suite_folder(name: str) -> Path:
    """Where the files of a suite lie: one that ships with RoboEval, one that a package brings, or a folder.

    Args:
        name: of the suite, or its folder.

    Raises:
        BadInput: there is no such suite.
    """
    if name in shipped_suites():
        return SUITES / name
    if SUITE_NAME.fullmatch(name) and (brought := installed_folder(name)) is not None:
        return brought.resolve()
    folder = Path(name)
    if not (folder / "suite.yaml").is_file():
        known = dict.fromkeys([*shipped_suites(), *(suite.name for suite in installed_suites())])
        raise BadInput(
            f'there is no suite "{name}": neither one of {", ".join(known)} nor a folder with a suite.yaml'
        )
    return folder.resolve()


def task_files(folder: Path) -> list[Path]:
    """One file a task, which is named as it, in the order of their names.

    Args:
        folder: of a suite.
    """
    return sorted((folder / "tasks").glob("*.yaml"))


def _read_suite(folder: Path, skills: SkillTable, count: int | None = None, seed: int | None = None) -> Suite:
    """The suite in a folder as its files are now, which are read again only if they have changed."""
    files = [folder / "suite.yaml", *task_files(folder)]
    stats = [(file.name, file.stat()) for file in files if file.is_file()]
    as_they_are = tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)
    return _suite_of(folder, skills, count, seed, as_they_are)


Files: TypeAlias = tuple[tuple[str, int, int], ...]
"""The name, the time of the last change in nanoseconds, and the size in bytes of each."""


@lru_cache(maxsize=8)  # a training loop may draw other worlds for each step
def _suite_of(
    folder: Path, skills: SkillTable, count: int | None, seed: int | None, _as_they_are: Files
) -> Suite:
    file = YamlFile.read(folder / "suite.yaml")
    head = file.validate(SuiteFile)
    if head.name.endswith(ABLATED):
        sentence = f'"{head.name}" ends as the files of an ablation do; choose a name without "{ABLATED}"'
        raise file.wrong(sentence, "name")
    paths = task_files(folder)
    if not paths:
        raise BadInput("the suite has no tasks; put one file a task there", file=folder / "tasks")
    documents = [YamlFile.read(path) for path in paths]
    lot = Lot(count or head.worlds, head.seed if seed is None else seed)
    lenders = [
        None if head.instructions is None else _lender(file, head.instructions, path) for path in paths
    ]
    tasks = [
        read_task(document, path, skills, lender=lender, lot=lot, words=head.rules.words_for_people)
        for document, path, lender in zip(documents, paths, lenders, strict=True)
    ]
    content = [file.data, *(document.data for document in documents)]
    content += [lender.data for lender in lenders if lender is not None]
    drawn = [task for task in tasks if task.drawn]
    content += [
        [scenario.world.to_data(), *(requirement.text for requirement in scenario.require)]
        for task in drawn
        for scenario in task.scenarios
    ]
    canonical = json.dumps(content, sort_keys=True, default=str)
    return Suite(
        name=head.name,
        version=head.version,
        about=head.about,
        rules=head.rules.rules(),
        tasks={task.name: task for task in tasks},
        digest=hashlib.sha256(canonical.encode()).hexdigest(),
        further=partial(_further, folder, skills) if drawn else None,
        folder=folder,
        worlds=lot.count if drawn else None,
        seed=lot.seed if drawn else None,
        skills=skills,
    )


def _further(folder: Path, skills: SkillTable, task: Task, count: int, seed: int) -> tuple[Scenario, ...]:
    return _read_suite(folder, skills, count, seed).tasks[task.name].scenarios


def _lender(file: YamlFile, suite: str, path: Path) -> YamlFile:
    """The task file of another suite from which a task has its instruction."""
    lender = SUITES / suite / "tasks" / path.name
    if not lender.is_file():
        raise file.wrong(
            f'the suite "{suite}" has no task "{path.stem}" to take instructions from', "instructions"
        )
    return YamlFile.read(lender)
