"""Reads task files: checks, worlds that are listed or described, and what each of them requires."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.program import parse_expression
from codebotler.core.regex_flags import scope_flags
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.words import listed
from codebotler.core.yaml_files import YamlFile, YamlPath
from codebotler.rtl import RtlSyntaxError, parse
from codebotler.rtl.regex_words import first_choice
from codebotler.rtl.syntax import ANSWERED
from roboeval.suites.schema import DrawnTaskFile, RequirementFile, ScenarioFile, TaskFile
from roboeval.suites.task import Check, Requirement, Scenario, Task
from roboeval.suites.worlds import WorldSampler

LENT = ("summary", "abilities", "prompts")
PEOPLE = "people"  # in checks of drawn worlds: any person or word for people
START = "start"  # in checks: the room in which the robot starts

_PARAMETER = r" *[^\W\d]\w* *"
_USED = re.compile(r"\{([^\W\d]\w*)\}")
_HEAD = re.compile(rf"(\w+)(?:\(({_PARAMETER}(?:,{_PARAMETER})*)\))?")


def read_task(
    file: YamlFile,
    path: Path,
    skills: SkillTable = SKILLS,
    *,
    lender: YamlFile | None = None,
    count: int = 30,
    seed: int = 1,
    words: Sequence[str] = (),
) -> Task:
    """Turn a task file into a task.

    Args:
        file: the task file.
        path: where it lies.
        skills: what can stand in formulas.
        lender: the file from which it takes the instruction, if it has none of its own.
        count: how many worlds to draw at least, if it describes them.
        seed: from which they are drawn.
        words: for people; `{people}` in a check of drawn worlds is one of them or the name of somebody there.

    Raises:
        UserError: it is wrong; the sentence names the line and the mend.
    """
    data = _borrowed(file, lender)
    drawn = isinstance(data, dict) and isinstance(data.get("worlds"), dict)
    form = file.validate(DrawnTaskFile, data) if drawn else file.validate(TaskFile, data)
    if form.name != path.stem:
        raise file.wrong(f'the task is named "{form.name}", but its file "{path.name}"', "name")
    ablation = None
    if isinstance(form, DrawnTaskFile):
        reader = _Reader(form, file, skills, _phrases(form, file, words))
        scenarios = tuple(reader.drawn(WorldSampler(form, file), count, seed))
    else:
        reader = _Reader(form, file, skills, {})
        _expect_different_worlds(form, file)
        scenarios = tuple(reader.listed(form.worlds))
        if any(world.ablation is not None for world in form.worlds):
            ablation = tuple(reader.ablated(form.worlds))
    return Task(
        name=form.name,
        summary=form.summary,
        abilities=form.abilities,
        prompts=tuple(prompt.strip() for prompt in form.prompts),
        facts=form.facts,
        checks=tuple(reader.checks.values()),
        scenarios=scenarios,
        ablation=ablation,
        accepted=form.accepted,
        path=path,
        borrows=lender is not None,
        drawn=isinstance(form, DrawnTaskFile),
        phrases=tuple(form.phrases.items()) if isinstance(form, DrawnTaskFile) else (),
        covered_by=tuple(_covered_by(form, file, reader.checks)),
    )


def _borrowed(file: YamlFile, lender: YamlFile | None) -> object:
    """The content of a task file, with the instruction of another one where it has none of its own."""
    if lender is None or not isinstance(file.data, dict) or not isinstance(lender.data, dict):
        return file.data
    lent = {name: lender.data[name] for name in LENT if name in lender.data}
    facts = [*lender.data.get("facts", []), *file.data.get("facts", [])]
    return {**lent, **file.data, "facts": facts}


def _covered_by(
    form: TaskFile | DrawnTaskFile, file: YamlFile, checks: Mapping[str, Check]
) -> Iterator[tuple[str, tuple[str, ...] | str]]:
    facts = {fact.fact for fact in form.facts}
    for fact, names in form.covered_by.items():
        if fact not in facts:
            raise file.wrong(f'there is no fact "{fact}"; they are under facts', "covered_by", fact)
        if isinstance(names, str) and names in checks:
            raise file.wrong(f'"{names}" is a check; write [{names}]', "covered_by", fact)
        if unknown := next((name for name in names if isinstance(names, list) and name not in checks), None):
            raise file.wrong(f'there is no check "{unknown}"; add it under checks', "covered_by", fact)
        yield fact, names if isinstance(names, str) else tuple(names)


def _expect_different_worlds(form: TaskFile, file: YamlFile) -> None:
    numbers: dict[str, int] = {}
    for number, world in enumerate(form.worlds, 1):
        first = numbers.setdefault(world.about.strip().casefold(), number)
        if first != number:
            sentence = f'world {number} is about "{world.about}", as world {first} is'
            raise file.wrong(f"{sentence}; say what is special in each", "worlds", number - 1, "about")


def _phrases(form: DrawnTaskFile, file: YamlFile, words: Sequence[str]) -> dict[str, str]:
    """Regexes that checks may name without a parameter: people, and the phrases of the task."""
    names = [person.name or key for key, person in form.worlds.people.items()]
    phrases = {PEOPLE: rf"(?:{'|'.join(map(scope_flags, [*words, *names]))})s?"}
    for name, regexes in form.phrases.items():
        if not name.isidentifier() or name in {PEOPLE, START}:
            raise file.wrong(f'"{name}" cannot name phrases; choose another word', "phrases", name)
        if not any(f"{{{name}}}" in check.rtl for check in form.checks.values()):
            raise file.wrong(f'no check uses the phrases "{name}"; write {{{name}}} in one', "phrases", name)
        if quoted := next((regex for regex in regexes if '"' in regex), None):
            raise file.wrong(f"{quoted} has a quotation mark, which phrases cannot have", "phrases", name)
        phrases[name] = f"(?:{'|'.join(map(scope_flags, regexes))})"
    return phrases


def _filled(text: str, given: Mapping[str, str]) -> str:
    for name, value in given.items():
        text = text.replace(f"{{{name}}}", value)
    return text


@dataclass(frozen=True)
class _Reader:
    """The checks and requirements of one task file."""

    form: TaskFile | DrawnTaskFile
    file: YamlFile
    skills: SkillTable
    phrases: Mapping[str, str]
    checks: dict[str, Check] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self.checks.update((check.name, check) for check in map(self._check, self.form.checks))

    def _check(self, head: str) -> Check:
        def wrong(sentence: str, *place: str) -> UserError:
            return self.file.wrong(sentence, "checks", head, *place)

        match, body = _HEAD.fullmatch(head), self.form.checks[head]
        if match is None:
            raise wrong(f'"{head}" is not the head of a check; write name or name(p1, p2)')
        name = match[1]
        parameters = tuple(p.strip() for p in match[2].split(",")) if match[2] else ()
        if START in parameters:
            raise wrong(f'a parameter cannot be called "{START}", which is the room of the robot; rename it')
        if again := next((p for n, p in enumerate(parameters) if p in parameters[:n]), None):
            raise wrong(f'the check "{name}" has two parameters "{again}"; rename one')
        for used in _USED.findall(body.rtl):
            if used not in parameters and used not in self.phrases and used != START:
                known = f"its parameters are: {', '.join(parameters)}" if parameters else "it takes none"
                raise wrong(f'the check "{name}" has no parameter "{used}"; {known}', "rtl")
        means = self._means(head, parameters)
        if unused := next((p for p in parameters if f"{{{p}}}" not in body.rtl), None):
            sentence = f'the check "{name}" does not use its parameter "{unused}"'
            raise wrong(f"{sentence}; write {{{unused}}} in its rtl", "rtl")
        line = self.file.line(("checks", head))
        return Check(name, parameters, body.category, body.rtl, body.commonsense, line, means)

    def _means(self, head: str, parameters: Sequence[str]) -> dict[str, str]:
        """What the texts of a check come to, by the kind of event."""
        body = self.form.checks[head]
        for kind, meaning in body.means.items():
            if kind not in self.skills.recordings and kind != ANSWERED:
                kinds = listed([*self.skills.recordings, ANSWERED])
                sentence = f'no element is called "{kind}"; there is {kinds}'
                raise self.file.wrong(sentence, "checks", head, "means", kind)
            if unknown := {*_USED.findall(meaning)} - {*parameters, START}:
                sentence = f'"{min(unknown)}" is no parameter of the check; write words in its place'
                raise self.file.wrong(sentence, "checks", head, "means", kind)
        return {**({"check": "a person"} if f"{{{PEOPLE}}}" in body.rtl else {}), **body.means}

    # --- worlds

    def listed(self, worlds: Sequence[ScenarioFile]) -> Iterator[Scenario]:
        for number, world in enumerate(worlds):
            at = ("worlds", number)
            require = self._requirements(world.require, world.robot, (*at, "require"))
            yield Scenario(world.world(self.file, at, self.skills), require)

    def ablated(self, worlds: Sequence[ScenarioFile]) -> Iterator[Scenario]:
        if any(world.ablation is None for world in worlds):
            raise self.file.wrong("some worlds have an ablation and some have none", "worlds")
        for number, form in enumerate(worlds):
            at = ("worlds", number)
            people = form.people if form.ablation_people is None else form.ablation_people
            world = form.model_copy(update={"people": people}).world(self.file, at, self.skills)
            require = self._requirements(form.ablation or [], world.robot, (*at, "ablation"))
            yield Scenario(world, require)

    def drawn(self, sampler: WorldSampler, count: int, seed: int) -> Iterator[Scenario]:
        known: dict[tuple[str, int, str], Requirement] = {}
        for number, form in enumerate(sampler.form.require):  # also of what no world requires
            self._words(form.prompts or {}, ("require", number, "prompts"))
        for setting in sampler.settings(count, seed):
            require = [(text, number, setting.start) for text, number in sampler.requirements(setting)]
            for text, number, start in require:
                if (text, number, start) not in known:
                    at, form = ("require", number), sampler.form.require[number]
                    known[text, number, start] = self._requirement(text, form.prompts, start, at)
            yield Scenario(sampler.world(setting), tuple(known[one] for one in require))

    # --- requirements

    def _requirements(
        self, forms: Sequence[RequirementFile], start: str, at: YamlPath
    ) -> tuple[Requirement, ...]:
        return tuple(
            self._requirement(form.check, form.prompts, start, (*at, index))
            for index, form in enumerate(forms)
        )

    def _requirement(
        self, text: str, prompts: Mapping[int, str] | None, start: str, at: YamlPath
    ) -> Requirement:
        bare = text.strip().removeprefix("not ")
        name, arguments = self._call(text, bare, at)
        check = self.checks.get(name)
        if check is None:
            raise self.file.wrong(f'there is no check "{name}"; add it under checks', *at)
        if len(arguments) != len(check.parameters):
            takes = ", ".join(check.parameters) or "no argument"
            raise self.file.wrong(
                f'the check "{name}" takes {takes}, but "{text}" gives {len(arguments)}', *at
            )
        given = {**self.phrases, START: start, **dict(zip(check.parameters, arguments, strict=True))}
        rtl = _filled(check.rtl, given)
        spoken = {START: start, **{p: first_choice(given[p]) for p in check.parameters}}
        means = {kind: _filled(meaning, spoken) for kind, meaning in check.means.items()}
        try:
            formula = parse(f"not ({rtl})" if bare != text.strip() else rtl, skills=self.skills, means=means)
        except RtlSyntaxError as error:
            sentence = f'the check "{name}" is not a valid formula ({error})'
            raise UserError(sentence, file=self.file.name, line=check.line) from None
        words = self._words(prompts or {}, (*at, "prompts"))
        return Requirement(text, name, formula, check.category, self.file.line(at), words)

    def _words(self, prompts: Mapping[int, str], at: YamlPath) -> tuple[tuple[int, str], ...]:
        """The words of prompts on which a requirement rests, which must stand in them."""
        known = self.form.prompts
        for number, words in prompts.items():
            if not 0 <= number < len(known):
                sentence = f"there is no prompt {number}; there is {listed([*map(str, range(len(known)))])}"
                raise self.file.wrong(sentence, *at, number)
            quoted = rf"(?<!\w){re.escape(' '.join(words.split()))}(?!\w)"
            if re.search(quoted, " ".join(known[number].split()), re.IGNORECASE) is None:
                sentence = f'prompt {number} does not say "{words}"; quote it word for word'
                raise self.file.wrong(sentence, *at, number)
        return tuple(prompts.items())

    def _call(self, text: str, bare: str, at: YamlPath) -> tuple[str, list[str]]:
        try:
            node = parse_expression(bare)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            node = ast.Constant(None)
        match node:
            case ast.Name(name):
                return name, []
            case ast.Call(ast.Name(name), arguments, []):
                values = [a.value for a in arguments if isinstance(a, ast.Constant)]
                if len(values) == len(arguments) and all(isinstance(value, str | int) for value in values):
                    return name, [*map(str, values)]
        sentence = f'"{text}" is not a requirement; write check, check("x", 2) or not check(...)'
        raise self.file.wrong(sentence, *at)
