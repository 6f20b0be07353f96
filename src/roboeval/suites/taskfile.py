"""Reads task files: checks, listed or sampled worlds, and the requirements of each."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.program import parse_expression
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.labels import scope_flags
from codebotler.core.text.words import counted, listed
from codebotler.core.yaml_files import YamlFile, YamlPath
from codebotler.rtl import RtlSyntaxError, parse
from codebotler.rtl.regex_words import first_choice
from codebotler.rtl.syntax import ANSWERED
from roboeval.suites.sampling.worlds import WorldSampler
from roboeval.suites.schema import RequirementFile, SampledTaskFile, ScenarioFile, TaskFile
from roboeval.suites.task import Requirement, Scenario, Task, TaskCheck

BORROWED_FIELDS = ("summary", "abilities", "prompts")
PEOPLE_PLACEHOLDER = "people"  # in checks for sampled worlds: matches any person's name or word for people
START = "start"  # in checks: the room where the robot starts

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
    """Convert a task file to a task.

    Args:
        file: the task file.
        path: its path.
        skills: the skills that formulas may use.
        lender: the task file whose instruction and facts the task borrows, or None.
        count: the minimum number of worlds to sample.
        seed: the random seed of sampled worlds.
        words: words for people that `{people}` in a check matches in addition to names.

    Raises:
        UserError: the file is not valid. The message names the line.
    """
    data = _with_borrowed(file, lender)
    is_sampled = isinstance(data, dict) and isinstance(data.get("worlds"), dict)
    form = file.validate(SampledTaskFile, data) if is_sampled else file.validate(TaskFile, data)
    if form.name != path.stem:
        sentence = f'the task is named "{form.name}", but its file is "{path.name}"; use the same name'
        raise file.wrong(sentence, "name")
    ablation = None
    if isinstance(form, SampledTaskFile):
        reader = _Reader(form, file, skills, _phrases(form, file, words))
        scenarios = tuple(reader.sample(WorldSampler(form, file), count, seed))
    else:
        reader = _Reader(form, file, skills, {})
        _expect_different_worlds(form, file)
        scenarios = tuple(reader.read_worlds(form.worlds))
        if any(world.ablation is not None for world in form.worlds):
            ablation = tuple(reader.read_ablation(form.worlds))
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
        is_sampled=isinstance(form, SampledTaskFile),
        phrases=tuple(form.phrases.items()) if isinstance(form, SampledTaskFile) else (),
        covered_by=tuple(_covered_by(form, file, reader.checks)),
    )


def _with_borrowed(file: YamlFile, lender: YamlFile | None) -> object:
    """Return the content of a task file, with the instruction and facts of the lender if there is one."""
    if lender is None or not isinstance(file.data, dict) or not isinstance(lender.data, dict):
        return file.data
    borrowed = {name: lender.data[name] for name in BORROWED_FIELDS if name in lender.data}
    facts = [*lender.data.get("facts", []), *file.data.get("facts", [])]
    return {**borrowed, **file.data, "facts": facts}


def _covered_by(
    form: TaskFile | SampledTaskFile, file: YamlFile, checks: Mapping[str, TaskCheck]
) -> Iterator[tuple[str, tuple[str, ...] | str]]:
    facts = {fact.fact for fact in form.facts}
    for fact, names in form.covered_by.items():
        if fact not in facts:
            raise file.wrong(f'there is no fact "{fact}"; add it under facts', "covered_by", fact)
        if isinstance(names, str) and names in checks:
            raise file.wrong(f'the check "{names}" must be in a list; write [{names}]', "covered_by", fact)
        if unknown := next((name for name in names if isinstance(names, list) and name not in checks), None):
            raise file.wrong(f'there is no check "{unknown}"; add it under checks', "covered_by", fact)
        yield fact, names if isinstance(names, str) else tuple(names)


def _expect_different_worlds(form: TaskFile, file: YamlFile) -> None:
    numbers: dict[str, int] = {}
    for number, world in enumerate(form.worlds, 1):
        first = numbers.setdefault(world.about.strip().casefold(), number)
        if first != number:
            sentence = f'worlds {first} and {number} have the same description "{world.about}"'
            raise file.wrong(f"{sentence}; give each its own description", "worlds", number - 1, "about")


def _phrases(form: SampledTaskFile, file: YamlFile, words: Sequence[str]) -> dict[str, str]:
    """Return the regexes that checks may use by name: for people, and the phrases of the task."""
    names = [person.name or key for key, person in form.worlds.people.items()]
    phrases = {PEOPLE_PLACEHOLDER: rf"(?:{'|'.join(map(scope_flags, [*words, *names]))})s?"}
    for name, regexes in form.phrases.items():
        if not name.isidentifier() or name in {PEOPLE_PLACEHOLDER, START}:
            why = "is reserved, or has other characters than letters, digits and _"
            raise file.wrong(f'the name "{name}" {why}; rename the phrases', "phrases", name)
        phrases[name] = f"(?:{'|'.join(map(scope_flags, regexes))})"
    return phrases


def _fill(text: str, values: Mapping[str, str]) -> str:
    for name, value in values.items():
        text = text.replace(f"{{{name}}}", value)
    return text


@dataclass(frozen=True)
class _Reader:
    """Builds the checks, requirements and worlds of a task file."""

    form: TaskFile | SampledTaskFile
    file: YamlFile
    skills: SkillTable
    phrases: Mapping[str, str]
    checks: dict[str, TaskCheck] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self.checks.update((check.name, check) for check in map(self._check, self.form.checks))

    def _check(self, head: str) -> TaskCheck:
        def wrong(sentence: str, *place: str) -> UserError:
            return self.file.wrong(sentence, "checks", head, *place)

        match, body = _HEAD.fullmatch(head), self.form.checks[head]
        if match is None:
            raise wrong(f'"{head}" is not a valid name of a check; write name or name(p1, p2)')
        name = match[1]
        parameters = tuple(p.strip() for p in match[2].split(",")) if match[2] else ()
        if START in parameters:
            raise wrong(f'"{START}" is reserved for the starting room of the robot; rename the parameter')
        for used in _USED.findall(body.rtl):
            if used not in parameters and used not in self.phrases and used != START:
                known = f"use {listed(parameters, 'or')}" if parameters else f"declare it as {name}({used})"
                raise wrong(f'the check "{name}" has no parameter "{used}"; {known}', "rtl")
        means = self._means(head, parameters)
        if unused := next((p for p in parameters if f"{{{p}}}" not in body.rtl), None):
            sentence = f'the check "{name}" does not use its parameter "{unused}"'
            raise wrong(f"{sentence}; add {{{unused}}} to the formula", "rtl")
        line = self.file.line(("checks", head))
        return TaskCheck(name, parameters, body.category, body.rtl, body.commonsense, line, means)

    def _means(self, head: str, parameters: Sequence[str]) -> dict[str, str]:
        body = self.form.checks[head]
        for kind, meaning in body.means.items():
            if kind not in self.skills.recordings and kind != ANSWERED:
                kinds = listed([*self.skills.recordings, ANSWERED])
                sentence = f'there is no kind of event "{kind}"; use {kinds}'
                raise self.file.wrong(sentence, "checks", head, "means", kind)
            if unknown := {*_USED.findall(meaning)} - {*parameters, START}:
                sentence = f'"{min(unknown)}" is not a parameter of the check; write a description instead'
                raise self.file.wrong(sentence, "checks", head, "means", kind)
        return {**({"check": "a person"} if f"{{{PEOPLE_PLACEHOLDER}}}" in body.rtl else {}), **body.means}

    def read_worlds(self, worlds: Sequence[ScenarioFile]) -> Iterator[Scenario]:
        for number, form in enumerate(worlds):
            yield self._scenario(form, form.require, ("worlds", number), "require")

    def read_ablation(self, worlds: Sequence[ScenarioFile]) -> Iterator[Scenario]:
        if any(world.ablation is None for world in worlds):
            raise self.file.wrong("some worlds have no ablation; add one to all worlds or to none", "worlds")
        for number, form in enumerate(worlds):
            people = form.people if form.ablation_people is None else form.ablation_people
            changed = form.model_copy(update={"people": people})
            yield self._scenario(changed, form.ablation or [], ("worlds", number), "ablation")

    def _scenario(
        self, form: ScenarioFile, forms: Sequence[RequirementFile], at: YamlPath, key: str
    ) -> Scenario:
        require = tuple(
            self._requirement(one.check, one.prompts, form.robot, (*at, key, index))
            for index, one in enumerate(forms)
        )
        return Scenario(form.world(self.file, at, self.skills), require)

    def sample(self, sampler: WorldSampler, count: int, seed: int) -> Iterator[Scenario]:
        known: dict[tuple[str, int, str], Requirement] = {}
        for number, form in enumerate(sampler.form.require):  # also validate requirements that no world has
            self._words(form.prompts or {}, ("require", number, "prompts"))
        for setting in sampler.settings(count, seed):
            require = [(text, number, setting.start) for text, number in sampler.requirements(setting)]
            for text, number, start in require:
                if (text, number, start) not in known:
                    at, form = ("require", number), sampler.form.require[number]
                    known[text, number, start] = self._requirement(text, form.prompts, start, at)
            yield Scenario(sampler.world(setting), tuple(known[one] for one in require))

    def _requirement(
        self, text: str, prompts: Mapping[int, str] | None, start: str, at: YamlPath
    ) -> Requirement:
        bare = text.strip().removeprefix("not ")
        name, arguments = self._call(text, bare, at)
        check = self.checks.get(name)
        if check is None:
            raise self.file.wrong(f'there is no check "{name}"; add it under checks', *at)
        if len(arguments) != len(check.parameters):
            takes, given = ", ".join(check.parameters) or "no argument", counted(len(arguments), "argument")
            raise self.file.wrong(f'the check "{name}" takes {takes}, but "{text}" has {given}', *at)
        values = {**self.phrases, START: start, **dict(zip(check.parameters, arguments, strict=True))}
        rtl = _fill(check.rtl, values)
        spoken = {START: start, **{p: first_choice(values[p]) for p in check.parameters}}
        means = {kind: _fill(meaning, spoken) for kind, meaning in check.means.items()}
        try:
            formula = parse(f"not ({rtl})" if bare != text.strip() else rtl, skills=self.skills, means=means)
        except RtlSyntaxError as error:
            sentence = f'the formula of the check "{name}" is not valid ({error})'
            raise UserError(sentence, file=self.file.name, line=check.line) from None
        words = self._words(prompts or {}, (*at, "prompts"))
        line = self.file.line(at)
        return Requirement(text, name, formula, check.category, line, words, tuple(arguments))

    def _words(self, prompts: Mapping[int, str], at: YamlPath) -> tuple[tuple[int, str], ...]:
        """Return the words that ask for a requirement, after checking that the prompts contain them."""
        known = self.form.prompts
        for number, words in prompts.items():
            if not 0 <= number < len(known):
                sentence = f"there is no prompt {number}; use {listed([*map(str, range(len(known)))])}"
                raise self.file.wrong(sentence, *at, number)
            quoted = rf"(?<!\w){re.escape(' '.join(words.split()))}(?!\w)"
            if re.search(quoted, " ".join(known[number].split()), re.IGNORECASE) is None:
                sentence = f'prompt {number} does not contain "{words}"; quote it literally'
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
        sentence = f'"{text}" is not a requirement; write check, check("x", 2) or not check("x")'
        raise self.file.wrong(sentence, *at)
