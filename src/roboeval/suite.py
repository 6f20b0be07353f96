"""Suites and tasks: what is asked of a robot, in which worlds, and which requirements each world has."""

from __future__ import annotations

import ast
import hashlib
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypeAlias

from codebotler.badinput import BadInput, Place, YamlFile
from codebotler.rtl import Formula, RtlSyntaxError, parse
from codebotler.simulator.rules import Rules
from codebotler.skills import SKILLS, SkillTable
from codebotler.world import World
from roboeval.suitefile import Ability, Category, ScenarioFile, SuiteFile, TaskFile

ABLATED = "-ablation"  # at the end of the name of an evaluation's files, and so of no suite's
SUITES = Path(__file__).with_name("suites")


@dataclass(frozen=True)
class Requirement:
    """What the trace of a program must satisfy in a world (paper, section IV.B).

    Args:
        text: as the task file says it, such as `not greets("amy")`.
        check: the name of the check that it applies.
        formula: the constraint, negated where the text says so.
        category: the class of failure if it does not hold.
        line: where it stands in the task file.
    """

    text: str
    check: str
    formula: Formula
    category: Category
    line: int | None = None


@dataclass(frozen=True)
class Scenario:
    """A world and what it requires; with `ablation` only common sense is required of it."""

    world: World
    require: tuple[Requirement, ...]


@dataclass(frozen=True)
class Fact:
    """Something the requirements rest on.

    Args:
        fact: what it is, in a sentence.
        words: regexes; at least one is found in every prompt, or none in any where it is common sense.
        commonsense: whether the model must know it without being told.
    """

    fact: str
    words: tuple[str, ...]
    commonsense: bool = False


@dataclass(frozen=True)
class Check:
    """A named constraint of a task.

    Args:
        name: how requirements call it.
        parameters: names of what is put into its text.
        category: the class of failure if it does not hold.
        rtl: the constraint with `{parameter}` where an argument goes.
        commonsense: whether it tests what nobody told the model.
        line: where it stands in the task file.
    """

    name: str
    parameters: tuple[str, ...]
    category: Category
    rtl: str
    commonsense: bool
    line: int | None = None


@dataclass(frozen=True)
class Accepted:
    """A finding of the linter that is there on purpose."""

    finding: str
    because: str


@dataclass(frozen=True)
class Task:
    """One task of a suite: prompts, worlds, requirements (paper, section IV).

    Args:
        name: as rows of completions call it.
        summary: what it is about, in a sentence.
        abilities: what it takes.
        prompts: phrasings of the same instruction.
        facts: what the requirements rest on.
        checks: the named constraints.
        scenarios: the worlds with their requirements.
        ablation: the same with the requirements of common sense only; None where the task has none.
        accepted: findings of the linter that are there on purpose.
        path: the file it was read from.
    """

    name: str
    summary: str
    abilities: tuple[Ability, ...]
    prompts: tuple[str, ...]
    facts: tuple[Fact, ...]
    checks: tuple[Check, ...]
    scenarios: tuple[Scenario, ...]
    ablation: tuple[Scenario, ...] | None
    accepted: tuple[Accepted, ...]
    path: Path

    def judged_in(self, *, ablated: bool = False) -> tuple[Scenario, ...]:
        """The worlds and requirements by which programs are judged; none if there is no ablation."""
        return (self.ablation or ()) if ablated else self.scenarios


Further: TypeAlias = Callable[[Task, int, int], tuple[Scenario, ...]]
"""Makes so many worlds of a task with what they require, from a seed; the same seed makes the same ones."""


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
    """

    name: str
    version: int
    about: str
    rules: Rules
    tasks: Mapping[str, Task]
    digest: str
    further: Further | None = None

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


def load_suite(name: str = "paper", *, skills: SkillTable = SKILLS) -> Suite:
    """Read a suite.

    Args:
        name: of a suite that ships with the package, or a folder.
        skills: what can stand in formulas.

    Raises:
        BadInput: there is no such suite, or one of its files is wrong.
    """
    folder = SUITES / name
    if not re.fullmatch(r"[a-z][a-z0-9-]*", name) or not folder.is_dir():
        folder = Path(name)
    if not (folder / "suite.yaml").is_file():
        shipped = ", ".join(sorted(path.parent.name for path in SUITES.glob("*/suite.yaml")))
        raise BadInput(f'there is no suite "{name}": neither one of {shipped} nor a folder with a suite.yaml')
    return _read_suite(folder.resolve(), skills)


@cache
def _read_suite(folder: Path, skills: SkillTable) -> Suite:
    file = YamlFile.read(folder / "suite.yaml")
    head = file.validate(SuiteFile)
    if head.name.endswith(ABLATED):
        sentence = f'"{head.name}" ends as the files of an ablation do; choose a name without "{ABLATED}"'
        raise file.wrong(sentence, "name")
    paths = sorted((folder / "tasks").glob("*.yaml"))
    if not paths:
        raise BadInput("the suite has no tasks; put one file a task there", file=folder / "tasks")
    documents = [YamlFile.read(path) for path in paths]
    tasks = [read_task(document, path, skills) for document, path in zip(documents, paths, strict=True)]
    content = [file.data, *(document.data for document in documents)]
    canonical = json.dumps(content, sort_keys=True, default=str)
    return Suite(
        name=head.name,
        version=head.version,
        about=head.about,
        rules=head.rules.rules(),
        tasks={task.name: task for task in tasks},
        digest=hashlib.sha256(canonical.encode()).hexdigest(),
    )


def read_task(file: YamlFile, path: Path, skills: SkillTable = SKILLS) -> Task:
    """Turn a task file into a task.

    Raises:
        BadInput: it is wrong; the sentence names the line and the mend.
    """
    form = file.validate(TaskFile)
    if form.name != path.stem:
        raise file.wrong(f'the task is named "{form.name}", but its file "{path.name}"', "name")
    _expect_different_worlds(form, file)
    checks = {check.name: check for check in _checks(form, file)}
    reader = _Reader(file, checks, skills)
    ablated = [world for world in form.worlds if world.ablation is not None]
    if ablated and len(ablated) != len(form.worlds):
        raise file.wrong("some worlds have an ablation and some have none", "worlds")
    return Task(
        name=form.name,
        summary=form.summary,
        abilities=tuple(form.abilities),
        prompts=tuple(prompt.strip() for prompt in form.prompts),
        facts=tuple(Fact(f.fact, tuple(f.words), f.commonsense) for f in form.facts),
        checks=tuple(checks.values()),
        scenarios=tuple(reader.scenario(world, ("worlds", i)) for i, world in enumerate(form.worlds)),
        ablation=tuple(reader.ablation(world, ("worlds", i)) for i, world in enumerate(form.worlds))
        if ablated
        else None,
        accepted=tuple(Accepted(a.finding, a.because) for a in form.accepted),
        path=path,
    )


def _expect_different_worlds(form: TaskFile, file: YamlFile) -> None:
    numbers: dict[str, int] = {}
    for number, world in enumerate(form.worlds, 1):
        first = numbers.setdefault(world.about.strip().casefold(), number)
        if first != number:
            sentence = f'world {number} is about "{world.about}", as world {first} is'
            raise file.wrong(f"{sentence}; say what is special in each", "worlds", number - 1, "about")


_PARAMETER = r" *[^\W\d]\w* *"


def _checks(form: TaskFile, file: YamlFile) -> list[Check]:
    checks = []
    for head, body in form.checks.items():
        match = re.fullmatch(rf"(\w+)(?:\(({_PARAMETER}(?:,{_PARAMETER})*)\))?", head)
        if match is None:
            raise file.wrong(f'"{head}" is no head of a check; write name or name(p1, p2)', "checks", head)
        parameters = tuple(p.strip() for p in match[2].split(",")) if match[2] else ()
        if again := next((p for n, p in enumerate(parameters) if p in parameters[:n]), None):
            sentence = f'the check "{match[1]}" has two parameters "{again}"; name them apart'
            raise file.wrong(sentence, "checks", head)
        for used in re.findall(r"\{([^\W\d]\w*)\}", body.rtl):
            if used not in parameters:
                known = f"its parameters are: {', '.join(parameters)}" if parameters else "it takes none"
                sentence = f'the check "{match[1]}" has no parameter "{used}"; {known}'
                raise file.wrong(sentence, "checks", head, "rtl")
        for parameter in parameters:
            if f"{{{parameter}}}" not in body.rtl:
                sentence = f'the check "{match[1]}" does not use its parameter "{parameter}"'
                raise file.wrong(f"{sentence}; write {{{parameter}}} in its rtl", "checks", head, "rtl")
        line = file.line(("checks", head))
        checks.append(Check(match[1], parameters, body.category, body.rtl, body.commonsense, line))
    return checks


@dataclass(frozen=True)
class _Reader:
    """Reads the worlds of one task file."""

    file: YamlFile
    checks: Mapping[str, Check]
    skills: SkillTable

    def scenario(self, form: ScenarioFile, at: Place) -> Scenario:
        world = form.world(self.file, at)
        return Scenario(world, self.requirements(form.require, (*at, "require")))

    def ablation(self, form: ScenarioFile, at: Place) -> Scenario:
        people = form.people if form.ablation_people is None else form.ablation_people
        world = form.model_copy(update={"people": people}).world(self.file, at)
        return Scenario(world, self.requirements(form.ablation or [], (*at, "ablation")))

    def requirements(self, texts: list[str], at: Place) -> tuple[Requirement, ...]:
        return tuple(self.requirement(text, (*at, index)) for index, text in enumerate(texts))

    def requirement(self, text: str, at: Place) -> Requirement:
        negated, name, arguments = self.parsed(text, at)
        check = self.checks.get(name)
        if check is None:
            raise self.file.wrong(f'there is no check "{name}"; add it under checks', *at)
        if len(arguments) != len(check.parameters):
            wanted = ", ".join(check.parameters) or "no argument"
            raise self.file.wrong(
                f'the check "{name}" takes {wanted}, but "{text}" gives {len(arguments)}', *at
            )
        rtl = check.rtl
        for parameter, argument in zip(check.parameters, arguments, strict=True):
            rtl = rtl.replace("{" + parameter + "}", argument)
        rtl = f"not ({rtl})" if negated else rtl
        try:
            formula = parse(rtl, skills=self.skills)
        except RtlSyntaxError as error:
            raise BadInput(
                f'the check "{name}" is no valid formula ({error})', file=self.file.name, line=check.line
            ) from None
        return Requirement(text, name, formula, check.category, self.file.line(at))

    def parsed(self, text: str, at: Place) -> tuple[bool, str, list[str]]:
        """Whether a requirement is negated, the name of its check, and the arguments as text."""
        bare = text.strip().removeprefix("not ")
        try:
            node = ast.parse(bare, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            node = ast.Constant(None)
        negated = bare != text.strip()
        match node:
            case ast.Name(name):
                return negated, name, []
            case ast.Call(ast.Name(name), arguments, []) if all(
                isinstance(a, ast.Constant) and isinstance(a.value, str | int) for a in arguments
            ):
                return negated, name, [str(a.value) for a in arguments if isinstance(a, ast.Constant)]
        raise self.file.wrong(
            f'"{text}" is no requirement; write check, check("x", 2) or not check(...)', *at
        )
