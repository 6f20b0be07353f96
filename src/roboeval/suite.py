"""Suites and tasks: what is asked of a robot, in which worlds, and which requirements each world has."""

from __future__ import annotations

import ast
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from codebotler.badinput import BadInput, Place, YamlFile
from codebotler.rtl import Formula, RtlSyntaxError, parse
from codebotler.simulator.rules import Rules
from codebotler.skills import SKILLS, SkillTable
from codebotler.world import World
from roboeval.suitefile import Ability, Category, DrawnTaskFile, ScenarioFile, SuiteFile, TaskFile
from roboeval.worlds import Description

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
        borrows: whether its instruction is that of a task that ships with the package.
        drawn: whether its worlds are drawn from a description.
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
    borrows: bool = False
    drawn: bool = False

    def judged_in(self, *, ablated: bool = False) -> tuple[Scenario, ...]:
        """The worlds and requirements by which programs are judged; none if there is no ablation."""
        return (self.ablation or ()) if ablated else self.scenarios


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
        folder: where it was read from.
        worlds: how many worlds a task has at least, where they are drawn; None where they are written by hand.
        seed: from which they are drawn.
    """

    name: str
    version: int
    about: str
    rules: Rules
    tasks: Mapping[str, Task]
    digest: str
    folder: Path | None = None
    worlds: int | None = None
    seed: int | None = None

    def with_worlds(self, count: int | None = None, seed: int | None = None) -> Suite:
        """The same suite with other worlds, drawn from the same descriptions.

        Args:
            count: how many a task; as many as now by default.
            seed: from which to draw them; the same as now by default.

        Raises:
            BadInput: its worlds are written by hand.
        """
        if self.worlds is None or self.folder is None:
            raise BadInput(f'the worlds of the suite "{self.name}" are written by hand; it has no others')
        return _read_suite(self.folder, SKILLS, count or self.worlds, self.seed if seed is None else seed)

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
def _read_suite(folder: Path, skills: SkillTable, count: int | None = None, seed: int | None = None) -> Suite:
    file = YamlFile.read(folder / "suite.yaml")
    head = file.validate(SuiteFile)
    if head.name.endswith(ABLATED):
        sentence = f'"{head.name}" ends as the files of an ablation do; choose a name without "{ABLATED}"'
        raise file.wrong(sentence, "name")
    paths = sorted((folder / "tasks").glob("*.yaml"))
    if not paths:
        raise BadInput("the suite has no tasks; put one file a task there", file=folder / "tasks")
    documents = [YamlFile.read(path) for path in paths]
    lot = Lot(count or head.worlds, head.seed if seed is None else seed)
    lenders = [
        None if head.instructions is None else _lender(file, head.instructions, path) for path in paths
    ]
    tasks = [
        read_task(document, path, skills, lender=lender, lot=lot)
        for document, path, lender in zip(documents, paths, lenders, strict=True)
    ]
    content = [file.data, *(document.data for document in documents)]
    content += [lender.data for lender in lenders if lender is not None]
    drawn = [task for task in tasks if task.drawn]
    content += [
        [scenario.world.to_yaml(), *(requirement.text for requirement in scenario.require)]
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
        folder=folder,
        worlds=lot.count if drawn else None,
        seed=lot.seed if drawn else None,
    )


@dataclass(frozen=True)
class Lot:
    """How worlds are drawn.

    Args:
        count: how many a task at least.
        seed: any whole number from 0 on.
    """

    count: int = 30
    seed: int = 1


def _lender(file: YamlFile, suite: str, path: Path) -> YamlFile:
    """The task file of another suite from which a task has its instruction."""
    lender = SUITES / suite / "tasks" / path.name
    if not lender.is_file():
        raise file.wrong(
            f'the suite "{suite}" has no task "{path.stem}" to take instructions from', "instructions"
        )
    return YamlFile.read(lender)


LENT = ("summary", "abilities", "prompts")


def _borrowed(file: YamlFile, lender: YamlFile | None) -> object:
    """What a task file says, with the instruction of another one where it has none of its own."""
    if lender is None or not isinstance(file.data, dict) or not isinstance(lender.data, dict):
        return file.data
    lent = {name: lender.data[name] for name in LENT if name in lender.data}
    facts = [*lender.data.get("facts", []), *file.data.get("facts", [])]
    return {**lent, **file.data, "facts": facts}


def read_task(
    file: YamlFile,
    path: Path,
    skills: SkillTable = SKILLS,
    *,
    lender: YamlFile | None = None,
    lot: Lot = Lot(),
) -> Task:
    """Turn a task file into a task.

    Args:
        file: the task file.
        path: where it lies.
        skills: what can stand in formulas.
        lender: the file from which it takes the instruction, if it has none of its own.
        lot: how worlds are drawn, if it describes them.

    Raises:
        BadInput: it is wrong; the sentence names the line and the mend.
    """
    data = _borrowed(file, lender)
    drawn = isinstance(data, dict) and isinstance(data.get("worlds"), dict)
    form: TaskFile | DrawnTaskFile = file.validate(DrawnTaskFile if drawn else TaskFile, data)
    if form.name != path.stem:
        raise file.wrong(f'the task is named "{form.name}", but its file "{path.name}"', "name")
    checks = {check.name: check for check in _checks(form, file)}
    reader = _Reader(file, checks, skills)
    if isinstance(form, DrawnTaskFile):
        scenarios, ablation = reader.drawn(Description(form, file), lot), None
    else:
        scenarios, ablation = reader.written(form)
    return Task(
        name=form.name,
        summary=form.summary,
        abilities=tuple(form.abilities),
        prompts=tuple(prompt.strip() for prompt in form.prompts),
        facts=tuple(Fact(f.fact, tuple(f.words), f.commonsense) for f in form.facts),
        checks=tuple(checks.values()),
        scenarios=scenarios,
        ablation=ablation,
        accepted=tuple(Accepted(a.finding, a.because) for a in form.accepted),
        path=path,
        borrows=lender is not None,
        drawn=isinstance(form, DrawnTaskFile),
    )


def _expect_different_worlds(form: TaskFile, file: YamlFile) -> None:
    numbers: dict[str, int] = {}
    for number, world in enumerate(form.worlds, 1):
        first = numbers.setdefault(world.about.strip().casefold(), number)
        if first != number:
            sentence = f'world {number} is about "{world.about}", as world {first} is'
            raise file.wrong(f"{sentence}; say what is special in each", "worlds", number - 1, "about")


_PARAMETER = r" *[^\W\d]\w* *"


def _checks(form: TaskFile | DrawnTaskFile, file: YamlFile) -> list[Check]:
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
    known: dict[tuple[str, Place], Requirement] = field(default_factory=dict)

    def written(self, form: TaskFile) -> tuple[tuple[Scenario, ...], tuple[Scenario, ...] | None]:
        """The worlds that a task lists, and those of its ablation."""
        _expect_different_worlds(form, self.file)
        ablated = [world for world in form.worlds if world.ablation is not None]
        if ablated and len(ablated) != len(form.worlds):
            raise self.file.wrong("some worlds have an ablation and some have none", "worlds")
        worlds = [*enumerate(form.worlds)]
        scenarios = tuple(self.scenario(world, ("worlds", i)) for i, world in worlds)
        return scenarios, tuple(self.ablation(w, ("worlds", i)) for i, w in worlds) if ablated else None

    def drawn(self, description: Description, lot: Lot) -> tuple[Scenario, ...]:
        """The worlds that are drawn from a task's description."""
        scenarios = []
        for setting in description.settings(lot.count, lot.seed):
            require = []
            for text, number in description.requirements(setting):
                known = text, ("require", number)
                if known not in self.known:
                    self.known[known] = self.requirement(*known)
                require.append(self.known[known])
            scenarios.append(Scenario(description.world(setting), tuple(require)))
        return tuple(scenarios)

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
