"""Reads suites from folders. A suite consists of tasks and the settings used to judge programs."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from codebotler.checking.house_rules.file import read_rules
from codebotler.core.errors import UserError
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.words import counted
from codebotler.core.yaml_files import YamlFile
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.settings import SimulationSettings
from roboeval.suites.schema import MAX_WORLDS, SuiteFile
from roboeval.suites.task import Task
from roboeval.suites.taskfile import read_task

if TYPE_CHECKING:
    from codebotler.models.recorded import InstructionSolutions

ABLATED = "-ablation"  # file suffix of ablations; suite names may not end like this
SUITES = Path(__file__).parent


@dataclass(frozen=True)
class HouseRules:
    """The house rules in a file. Evaluations stop a program before it breaks one of them."""

    name: str  # the file name without its ending, used in evaluation names; empty for a suite's own rules
    rules: tuple[Rule, ...]  # the rules, in file order
    digest: str  # the file's SHA-256 in hexadecimal

    def __post_init__(self) -> None:
        for rule in self.rules:
            if rule.inside:
                why = 'uses "inside", which evaluations do not support'
                raise UserError(f'the rule "{rule.name}" {why}; use a copy of the file without it')

    @classmethod
    def read(
        cls, path: Path, skills: SkillTable = SKILLS, rooms: Sequence[str] = (), *, of_suite: bool = False
    ) -> HouseRules:
        """Read a file of house rules. Raise UserError if a rule is invalid or names a room not in `rooms`.

        Empty `rooms` allow all rooms. With `of_suite`, for a suite's own rules, the file may have any name.
        """
        rules = read_rules(path, skills, rooms)
        if not of_suite and not re.fullmatch(r"[a-z0-9][a-z0-9-]*", path.stem):
            mend = "rename the file with only lower-case letters, digits and dashes"
            raise UserError(f'the name "{path.stem}" is not valid for house rules; {mend}', file=path)
        return cls("" if of_suite else path.stem, rules, hashlib.sha256(path.read_bytes()).hexdigest())


@dataclass(frozen=True)
class Suite:
    """A set of tasks and the settings used to judge programs.

    Args:
        worlds: the minimum number of worlds per task if they are sampled; None if they are written by hand.
        recorded: the programs of recorded models, if the tasks are generated.
    """

    name: str  # the name, which evaluations record
    version: int  # increased when verdicts may change
    about: str  # a one-sentence description
    settings: SimulationSettings  # how worlds are simulated
    tasks: Mapping[str, Task]  # the tasks, sorted by name
    digest: str  # a hash of everything that verdicts and prompts depend on
    folder: Path | None = None  # the folder of its files
    worlds: int | None = None
    seed: int | None = None  # the random seed of sampled worlds
    skills: SkillTable = SKILLS  # the skills that formulas may use
    house: HouseRules | None = None  # rules that stop a program
    is_generated: bool = False  # whether the tasks are generated from families
    recorded: tuple[InstructionSolutions, ...] = field(default=(), repr=False)

    def __hash__(self) -> int:
        return hash(self.digest)  # needed because dictionaries such as `tasks` are not hashable

    def __repr__(self) -> str:
        return f"Suite({self.name!r}, {counted(len(self.tasks), 'task')})"

    @property
    def house_rules(self) -> tuple[Rule, ...]:
        """Return the house rules, or an empty tuple if there are none."""
        return () if self.house is None else self.house.rules

    @property
    def house_sentences(self) -> list[str]:
        """Return the house rules as sentences for the model prompt."""
        return [rule.says for rule in self.house_rules]

    def with_house_rules(self, house: HouseRules | None) -> Suite:
        """Return the suite with these house rules instead of its own, or without house rules if None."""
        return self if house == self.house else replace(self, house=house)

    def with_worlds(self, count: int | None = None, seed: int | None = None) -> Suite:
        """Return the suite with the same house rules and other worlds, sampled from the same descriptions.

        Args:
            count: the number of worlds per task, 1 to 10,000; by default the current number.
            seed: the random seed; by default the current seed.

        Raises:
            UserError: the worlds are not sampled or depend on the suite's name, or `count` is out of range.
        """
        if self.worlds is None or self.folder is None:
            why = "are determined by its name" if self.is_generated else "are written by hand"
            raise UserError(f'the worlds of the suite "{self.name}" {why}; leave out --worlds and --seed')
        if count is not None and not 1 <= count <= MAX_WORLDS:
            raise UserError(f"the number of worlds is {count}, but it must be from 1 to {MAX_WORLDS:,}")
        seed = self.seed if seed is None else seed
        return read_suite(self.folder, self.skills, count or self.worlds, seed).with_house_rules(self.house)

    def with_own_worlds(self) -> Suite:
        """Undo `with_worlds`: read the suite again from its files, if its worlds are sampled."""
        if self.worlds is None or self.folder is None:
            return self
        return read_suite(self.folder, self.skills)

    def task(self, name: str) -> Task:
        """Return the task with this name. Raise UserError if there is none."""
        if name not in self.tasks:
            known = ", ".join(self.tasks)
            raise UserError(f'the suite "{self.name}" has no task "{name}"; its tasks are {known}')
        return self.tasks[name]


def task_files(folder: Path) -> list[Path]:
    """Return the sorted paths of the task files in a suite's folder."""
    return sorted((folder / "tasks").glob("*.yaml"))


def read_suite(folder: Path, skills: SkillTable, count: int | None = None, seed: int | None = None) -> Suite:
    """Read the suite in a folder. `count` (worlds per task) and `seed` replace the values in suite.yaml."""
    files = [*sorted(folder.glob("*.yaml")), *sorted(folder.glob("*.py")), *task_files(folder)]
    stats = [(file.name, file.stat()) for file in files if file.is_file()]
    versions = tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)
    return _build_suite(folder, skills, count, seed, versions)


@lru_cache(maxsize=8)  # limited because a training loop may sample new worlds at each step
def _build_suite(
    folder: Path,
    skills: SkillTable,
    count: int | None,
    seed: int | None,
    _versions: tuple[tuple[str, int, int], ...],
) -> Suite:
    file = YamlFile.read(folder / "suite.yaml")
    head = file.validate(SuiteFile)
    if head.name.endswith(ABLATED):
        sentence = f'the name "{head.name}" ends in "{ABLATED}", which is reserved; choose another'
        raise file.wrong(sentence, "name")
    paths = task_files(folder)
    if not paths:
        raise UserError("the folder contains no tasks; add a file for each task", file=folder / "tasks")
    count, seed = count or head.worlds, head.seed if seed is None else seed
    documents = [YamlFile.read(path) for path in paths]
    words = head.rules.words_for_people
    own = [folder / name for name in head.skills]
    new = (row for name, row in skills_from(*own).items() if name not in skills) if own else ()
    skills = SkillTable((*skills.rows, *new)) if own else skills
    lenders = [_lender(file, head.instructions, path) if head.instructions else None for path in paths]
    tasks = [
        read_task(document, path, skills, lender=lender, count=count, seed=seed, words=words)
        for document, path, lender in zip(documents, paths, lenders, strict=True)
    ]
    house = None
    if head.house_rules is not None:
        house = HouseRules.read(folder / head.house_rules, skills, rooms_in(tasks), of_suite=True)
    is_sampled = any(task.is_sampled for task in tasks)
    return Suite(
        name=head.name,
        version=head.version,
        about=head.about,
        settings=head.rules.settings(),
        tasks={task.name: task for task in tasks},
        digest=_digest([file, *documents, *filter(None, lenders)], tasks, house, own),
        house=house,
        folder=folder,
        worlds=count if is_sampled else None,
        seed=seed if is_sampled else None,
        skills=skills,
    )


def rooms_in(tasks: Iterable[Task]) -> list[str]:
    """Return the names of all rooms in the worlds of the tasks."""
    worlds = (scenario.world for task in tasks for scenario in task.scenarios)
    return list(dict.fromkeys(room.name for world in worlds for room in world.rooms))


def _lender(file: YamlFile, suite: str, path: Path) -> YamlFile:
    """Read the task file whose instruction a task borrows from another suite."""
    lender = SUITES / suite / "tasks" / path.name
    if not lender.is_file():
        sentence = f'the suite "{suite}" has no task "{path.stem}" to borrow instructions from'
        raise file.wrong(sentence, "instructions")
    return YamlFile.read(lender)


def _without_meanings(data: object) -> object:
    """Remove the texts that only explanations use, and no verdict depends on, from a file's content."""
    if not isinstance(data, dict) or not isinstance(data.get("checks"), dict):
        return data
    checks = {
        head: {key: value for key, value in check.items() if key != "means"}
        for head, check in data["checks"].items()
    }
    return {**data, "checks": checks}


def _digest(
    files: list[YamlFile], tasks: list[Task], house: HouseRules | None, skills: Sequence[Path]
) -> str:
    content: list[object] = [_without_meanings(file.data) for file in files]
    content += [hashlib.sha256(path.read_bytes()).hexdigest() for path in skills]
    if house is not None:
        content.append(house.digest)
    sampled = (scenario for task in tasks if task.is_sampled for scenario in task.scenarios)
    content += [[one.world.to_data(), *(requirement.text for requirement in one.require)] for one in sampled]
    canonical = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(canonical.encode()).hexdigest()
