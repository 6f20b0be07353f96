"""Reads task files: checks, worlds that are listed or described, and what each of them requires."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from codebotler.badinput import BadInput, Place, YamlFile
from codebotler.rtl import RtlSyntaxError, parse
from codebotler.skills import SKILLS, SkillTable
from codebotler.syntaxtree import parse_expression
from codebotler.world import expect_regex
from roboeval.suites.schema import DrawnTaskFile, ScenarioFile, TaskFile
from roboeval.suites.task import Accepted, Check, Fact, Requirement, Scenario, Task
from roboeval.suites.worlds import Description


@dataclass(frozen=True)
class Lot:
    """How worlds are drawn.

    Args:
        count: how many a task at least.
        seed: any whole number from 0 on.
    """

    count: int = 30
    seed: int = 1


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
    words: Sequence[str] = (),
) -> Task:
    """Turn a task file into a task.

    Args:
        file: the task file.
        path: where it lies.
        skills: what can stand in formulas.
        lender: the file from which it takes the instruction, if it has none of its own.
        lot: how worlds are drawn, if it describes them.
        words: for people; `{people}` in a check of drawn worlds is one of them or the name of somebody there.

    Raises:
        BadInput: it is wrong; the sentence names the line and the mend.
    """
    data = _borrowed(file, lender)
    drawn = isinstance(data, dict) and isinstance(data.get("worlds"), dict)
    form = file.validate(DrawnTaskFile, data) if drawn else file.validate(TaskFile, data)
    if form.name != path.stem:
        raise file.wrong(f'the task is named "{form.name}", but its file "{path.name}"', "name")
    for number, fact in enumerate(form.facts):
        for word in fact.words:
            expect_regex(word, file, ("facts", number, "words"))
    given = _given(form, file, words) if isinstance(form, DrawnTaskFile) else {}
    checks = {check.name: check for check in _checks(form, file, given)}
    reader = _Reader(file, checks, skills, given)
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
        phrases=tuple((n, tuple(r)) for n, r in form.phrases.items())
        if isinstance(form, DrawnTaskFile)
        else (),
    )


def _expect_different_worlds(form: TaskFile, file: YamlFile) -> None:
    numbers: dict[str, int] = {}
    for number, world in enumerate(form.worlds, 1):
        first = numbers.setdefault(world.about.strip().casefold(), number)
        if first != number:
            sentence = f'world {number} is about "{world.about}", as world {first} is'
            raise file.wrong(f"{sentence}; say what is special in each", "worlds", number - 1, "about")


_PARAMETER = r" *[^\W\d]\w* *"


PEOPLE = "people"
"""What every check of drawn worlds may name without a parameter: whoever a look may be for."""


def _given(form: DrawnTaskFile, file: YamlFile, words: Sequence[str]) -> dict[str, str]:
    """What checks may name without a parameter: people, and the phrases of the task."""
    names = [person.name or key for key, person in form.worlds.people.items()]
    given = {PEOPLE: rf"(?:{'|'.join([*words, *names])})s?"}
    for name, regexes in form.phrases.items():
        if not name.isidentifier() or name == PEOPLE:
            raise file.wrong(f'"{name}" cannot name phrases; choose another word', "phrases", name)
        if not any(f"{{{name}}}" in check.rtl for check in form.checks.values()):
            raise file.wrong(f'no check uses the phrases "{name}"; write {{{name}}} in one', "phrases", name)
        if quoted := next((regex for regex in regexes if '"' in regex), None):
            raise file.wrong(f"{quoted} has a quotation mark; phrases are put between two", "phrases", name)
        given[name] = f"(?:{'|'.join(regexes)})"
    return given


def _checks(form: TaskFile | DrawnTaskFile, file: YamlFile, given: Mapping[str, str]) -> list[Check]:
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
            if used not in parameters and used not in given:
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
    given: Mapping[str, str]
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
        for given, regex in self.given.items():
            rtl = rtl.replace("{" + given + "}", regex)
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
            node = parse_expression(bare)
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
