"""Generates the task of a family for a seed, with its own names, words and worlds."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from random import Random
from string import Template
from typing import Annotated, Any, TypeAlias

from pydantic import Field

from codebotler.core.errors import UserError
from codebotler.core.files import read_text
from codebotler.core.text.words import listed
from codebotler.core.world_file import Name, YamlText
from codebotler.core.yaml_files import YamlFile
from codebotler.rtl.formulas import And
from codebotler.rtl.syntax import parse
from roboeval.suites.schema import MAX_WORLDS, StrictForm, SuiteFile
from roboeval.suites.suite import Suite
from roboeval.suites.task import Requirement, Task
from roboeval.suites.taskfile import read_task

FAMILY_FOLDER = Path(__file__).parent
TRAINING_SUITE, TRAINING_WORLDS = "training", 8
NUMBER_WORDS = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
SEVERAL_WORDS = re.compile(r"(\d+) (\w+)")  # several distinct words from a pool, such as `3 rooms`
NUMBER_RANGE = re.compile(r"(\d+) to (\d+)")
SYNONYMS = re.compile(r"\{([^{}]*\|[^{}]*)\}")  # a choice of synonyms, such as {look|see}

# A robot that retracts its report has not reported.
RETRACTION = (
    r"\b(none|nothing|no part) of (that|this|it|what i)\b"
    r"|(?<!not )(?<!n\Wt )(?<!never )\b(forget|ignore|disregard|scratch|strike)"
    r" (all |any )?(of )?(it|that|this|what i)\b"
    r"|\b(that|this|it|which|all|everything)( i said)?(\Ws| is| was| were)( all)?"
    r" (not (true|right)|a lie|false|wrong|untrue|a joke)\b"
    r"|\b(that|this|it) (is|was)n\Wt (true|right)\b|^\W*not (true|right)\b|\bincorrect\b"
    r"|\b(never mind|do ?n\Wt believe me|do not believe me|disregard my|ignore my|april fool)\b"
    r"|\bi (lied|was (lying|wrong)|(take|made) (it|that|this|all) (back|up))\b"
    r"|\b(just|only|was) (kidding|joking)\b"
)

Choice: TypeAlias = Name | Annotated[list[Name], Field(min_length=1)]


class WrongProgram(StrictForm):
    """A program that does not do everything that was asked, and a description of its mistake."""

    about: Name
    program: YamlText


class FamilyFile(StrictForm):
    """The template file of a family, in which `$name` is replaced by a value chosen for each seed.

    Args:
        about: a one-sentence description of the tasks.
        choose: the choices by name: a word from a pool in words.yaml (`things`), several words (`3 rooms`),
            a number (`2 to 4`), or an entry of a list. No word is chosen twice.
        task: the content of a task file, without a name. In prompts, `{look|see}` is replaced by either word.
        solution: a program that is right in all worlds.
        wrong: incorrect programs, each with a reward below 1.
    """

    about: Name
    choose: dict[Name, Choice]
    task: dict[str, Any]
    solution: YamlText
    wrong: Annotated[tuple[WrongProgram, ...], Field(min_length=1)]


@dataclass(frozen=True)
class GeneratedTask:
    """A task generated from a family for one seed, with one correct program and several incorrect ones."""

    suite: Suite  # a suite that contains only this task
    name: str  # the family and the seed, such as `BringThing-17`
    solution: str  # a correct program's source
    wrong: tuple[WrongProgram, ...]  # programs that miss part of the instruction

    @property
    def prompts(self) -> tuple[str, ...]:
        """Return the phrasings of the task's instruction."""
        return self.suite.tasks[self.name].prompts

    def expect_prompt(self, index: int) -> None:
        """Raise UserError if the task has no prompt with this number, from 0."""
        if not 0 <= index < len(self.prompts):
            raise UserError(f"{self.name} has no prompt {index}; use 0 to {len(self.prompts) - 1}")


@cache
def family_names() -> tuple[str, ...]:
    """Return the sorted names of the task families (templates) that ship with RoboEval."""
    return tuple(sorted(path.stem for path in (FAMILY_FOLDER / "templates").glob("*.yaml")))


def family_file(family: str) -> Path:
    """Return the file of a family, given its name or a path. Raise UserError if there is no such file."""
    if family.endswith(".yaml") and Path(family).is_file():
        return Path(family)
    if family not in family_names():
        raise UserError(f'unknown family "{family}"; use {listed(family_names())}, or a .yaml file')
    return FAMILY_FOLDER / "templates" / f"{family}.yaml"


def trained_task(family: str, seed: int, *, worlds: int = TRAINING_WORLDS) -> GeneratedTask:
    """Generate a training task from a family (a template) for a seed. Equal arguments give equal tasks.

    Args:
        family: one of `family_names()`, or the path of a `.yaml` file, which is read only once.
        seed: an integer from 0, which determines names, words and worlds.
        worlds: the minimum number of worlds to sample, 1 to 10,000.

    Raises:
        UserError: the family does not exist, its file is not valid, or a number is out of range.
    """
    if not 1 <= worlds <= MAX_WORLDS:
        raise UserError(f"the number of worlds is {worlds}, but it must be from 1 to {MAX_WORLDS:,}")
    if type(seed) is not int or seed < 0:
        raise UserError(f"the seed is {seed!r}, but it must be a whole number from 0")
    return _generate(family, seed, worlds)


def trained_prompts(family: str, seed: int) -> tuple[str, ...]:
    """Generate only the prompts of `trained_task`, which is much faster because no world is sampled.

    For a `.yaml` file, call `trained_task` once beforehand to validate the file.
    """
    return tuple(_phrasings(*_choices(family, seed)))


@dataclass(frozen=True)
class _Template:
    """The template of a family, both as text and parsed."""

    path: Path
    text: str
    file: YamlFile
    form: FamilyFile


def _choices(family: str, seed: int) -> tuple[_Template, dict[str, str], Random]:
    """Return the template of a family, the value of each name for a seed, and the source of later choices."""
    template = _template(family_file(family))
    random = Random(f"{template.path.stem} {seed}")  # noqa: S311 - not for cryptography
    return template, dict(_choose(template.form, template.file, random)), random


@lru_cache(maxsize=1_024)
def _generate(family: str, seed: int, worlds: int) -> GeneratedTask:
    template, chosen, random = _choices(family, seed)
    path = template.path
    file = YamlFile(_fill(template.text, chosen, path), path)
    form = file.validate(FamilyFile)
    name = f"{path.stem}-{seed}"
    content = {"name": name, **form.task}
    if isinstance(content.get("prompts"), list):  # `read_task` reports invalid prompts
        content["prompts"] = [*_phrasings(template, chosen, random)]
    task_file = file.part("task", content)
    head = suite_file()
    words = head.rules.words_for_people
    task = read_task(task_file, path.with_name(f"{name}.yaml"), count=worlds, seed=seed, words=words)
    digest = hashlib.sha256(f"{head.version} {worlds} {seed} {task_file.data}".encode()).hexdigest()
    tasks = {name: _forbid_retraction(task)}
    suite = Suite(TRAINING_SUITE, head.version, head.about, head.rules.settings(), tasks, digest)
    return GeneratedTask(suite, name, form.solution, form.wrong)


def _forbid_retraction(task: Task) -> Task:
    """Change all requirements so that none of them holds once a program has retracted its report.

    A separate requirement would already hold at the start and so reward incorrect programs.
    """
    no_retraction = parse(f'not tr.Exists(say(r"{RETRACTION}"))')

    def strict(one: Requirement) -> Requirement:
        return replace(one, formula=And((one.formula, no_retraction)))

    scenarios = (replace(one, require=tuple(map(strict, one.require))) for one in task.scenarios)
    return replace(task, scenarios=tuple(scenarios))


def _choose(form: FamilyFile, file: YamlFile, random: Random) -> Iterator[tuple[str, str]]:
    used: set[str] = set()

    def sample(words: Sequence[str], count: int) -> list[str]:
        left = [word for word in dict.fromkeys(words) if word not in used]
        if len(left) < count:
            raise file.wrong(f"{count} words are needed, but {len(left)} are left; use fewer", "choose", name)
        some = random.sample(left, count)
        used.update(some)
        return some

    for name, choice in form.choose.items():
        if isinstance(choice, list):
            yield from _scalar(name, *sample(choice, 1))
        elif match := NUMBER_RANGE.fullmatch(choice):
            least, most = int(match[1]), int(match[2])
            if not least <= most < len(NUMBER_WORDS):
                mend = f"write ascending numbers up to {len(NUMBER_WORDS) - 1}, such as 2 to 4"
                raise file.wrong(f'the range "{choice}" is not valid; {mend}', "choose", name)
            number = random.randint(least, most)
            yield from ((name, str(number)), (f"{name}_word", NUMBER_WORDS[number]))
        elif match := SEVERAL_WORDS.fullmatch(choice):
            yield from _list(name, sample(_pool(match[2], file, name), int(match[1])))
        else:
            yield from _scalar(name, *sample(_pool(choice, file, name), 1))


def _pool(pool: str, file: YamlFile, name: str) -> list[str]:
    words = _words()
    if pool not in words:
        raise file.wrong(f'unknown pool "{pool}"; use {listed(list(words))}', "choose", name)
    return words[pool]


def _scalar(name: str, word: str) -> Iterator[tuple[str, str]]:
    """Yield the values of a word: as is, capitalised, with an article, and in the plural."""
    article = "an" if word[0] in "aeiou" else "a"
    plural = word + ("es" if word.endswith(("s", "x", "ch", "sh")) else "s")
    yield from ((name, word), (name.capitalize(), word[:1].upper() + word[1:]))
    yield from ((f"a_{name}", f"{article} {word}"), (f"{name}_s", plural))


def _list(name: str, words: list[str]) -> Iterator[tuple[str, str]]:
    """Yield the values of several words: as a YAML list, as a phrase, as a Python list, and one by one."""
    yield from ((name, ", ".join(words)), (f"{name}_and", listed(words)))
    yield f"{name}_quoted", "[" + ", ".join(f'"{word}"' for word in words) + "]"
    for number, word in enumerate(words, 1):
        yield from _scalar(f"{name}_{number}", word)


def _fill(text: str, chosen: Mapping[str, str], path: Path) -> str:
    for match in Template.pattern.finditer(text):
        if match["escaped"] is None and (match["named"] or match["braced"]) not in chosen:
            line = text.count("\n", 0, match.start()) + 1
            sentence = f'"{match[0]}" has no entry in choose; write $$ for a dollar sign'
            raise UserError(sentence, file=path, line=line)
    return Template(text).substitute(chosen)


def _phrasings(template: _Template, chosen: Mapping[str, str], random: Random) -> Iterator[Any]:
    for number, prompt in enumerate(template.form.task["prompts"]):
        if not isinstance(prompt, str):  # `read_task` reports the error
            yield prompt
            continue
        filled = _fill(prompt, chosen, template.path)
        text = " ".join(SYNONYMS.sub(lambda match: random.choice(match[1].split("|")), filled).split())
        if "{" in text or "}" in text:
            sentence = "braces are not balanced; write synonyms as {go|drive}"
            raise template.file.wrong(sentence, "task", "prompts", number)
        yield text


@cache
def _template(path: Path) -> _Template:
    text = read_text(path)
    file = YamlFile(text, path)
    return _Template(path, text, file, file.validate(FamilyFile))


@cache
def _words() -> Mapping[str, list[str]]:
    data = YamlFile.read(FAMILY_FOLDER / "words.yaml").data
    assert isinstance(data, dict)
    return data


@cache
def suite_file() -> SuiteFile:
    """Return the content of training.yaml: the version and the settings that all families share."""
    return YamlFile.read(FAMILY_FOLDER / "training.yaml").validate(SuiteFile)
