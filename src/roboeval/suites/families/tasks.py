"""Families of tasks: templates from which each seed makes a task with names, words and worlds of its own."""

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

from pydantic import BaseModel, ConfigDict, Field

from codebotler.core.errors import UserError
from codebotler.core.files import read_text
from codebotler.core.program import Flaw, parsed
from codebotler.core.skills.paper import SKILLS
from codebotler.core.words import listed
from codebotler.core.world_file import Name, YamlText
from codebotler.core.yaml_files import YamlFile
from codebotler.rtl.formulas import And
from codebotler.rtl.syntax import parse
from roboeval.suites.schema import MOST_WORLDS, SuiteFile
from roboeval.suites.suite import Suite
from roboeval.suites.task import Requirement, Task
from roboeval.suites.taskfile import read_task

FOLDER = Path(__file__).parent
SUITE, WORLDS = "training", 8
NUMBERS = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
SOME = re.compile(r"(\d+) (\w+)")  # so many different words of a pool
MARKS = frozenset("${}|")
RANGE = re.compile(r"(\d+) to (\d+)")
EITHER = re.compile(r"\{([^{}]*\|[^{}]*)\}")  # one of several words, which make no difference

# A report that is taken back is none, whatever the task is.
TAKES_BACK = (
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


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class WrongProgram(_Form):
    """A program that does not do what was asked, or not all of it."""

    about: Name
    program: YamlText


class FamilyFile(_Form):
    """A family before names are drawn; `$name` stands for what is chosen.

    Args:
        about: what its tasks are, in a sentence.
        choose: what is drawn for each seed, by name: from a pool of words.yaml (`things`), some from one
            (`3 rooms`), a number (`2 to 4`), or one of a list. No word is drawn twice.
        task: a task file without a name. In prompts, `{look|see}` is one of these words.
        solution: a program that is right in all worlds.
        wrong: programs that are not, each of which earns less than 1.
    """

    about: Name
    choose: dict[Name, Choice]
    task: dict[str, Any]
    solution: YamlText
    wrong: Annotated[tuple[WrongProgram, ...], Field(min_length=1)]


@dataclass(frozen=True)
class TrainedTask:
    """A task of a family.

    Args:
        suite: one that holds nothing but it.
        name: of the family and the seed, such as `BringThing-17`.
        solution: a program that is right.
        wrong: programs that are not.
    """

    suite: Suite
    name: str
    solution: str
    wrong: tuple[WrongProgram, ...]

    @property
    def prompts(self) -> tuple[str, ...]:
        """Its phrasings."""
        return self.suite.tasks[self.name].prompts

    def expect_prompt(self, index: int) -> None:
        """Raise a UserError if it has no phrasing with this number."""
        if not 0 <= index < len(self.prompts):
            raise UserError(f"{self.name} has no prompt {index}; it has {len(self.prompts)}, from 0")


@cache
def family_names() -> tuple[str, ...]:
    """The names of all families that are here, sorted."""
    return tuple(sorted(path.stem for path in (FOLDER / "templates").glob("*.yaml")))


def family_file(family: str) -> Path:
    """The file of a family.

    Args:
        family: one of `family_names()`, or a file of your own, which ends in `.yaml`.

    Raises:
        UserError: there is no such family.
    """
    if family.endswith(".yaml") and Path(family).is_file():
        return Path(family)
    if family not in family_names():
        raise UserError(
            f'there is no family "{family}"; there is {listed(family_names())}, or a .yaml file of your own'
        )
    return FOLDER / "templates" / f"{family}.yaml"


def trained_task(family: str, seed: int, *, worlds: int = WORLDS) -> TrainedTask:
    """The task that a family makes of a seed, the same on every machine.

    Args:
        family: one of `family_names()`, or a file of your own, which ends in `.yaml`; it is read once.
        seed: any number from 0; names, words and worlds depend on it.
        worlds: how many to draw at least, 1 to 10,000.

    Raises:
        UserError: there is no such family, its file is wrong, or a number is out of range.
    """
    if not 1 <= worlds <= MOST_WORLDS:
        raise UserError(f"the number of worlds is {worlds}, but it must be from 1 to {MOST_WORLDS:,}")
    if type(seed) is not int or seed < 0:
        raise UserError(f"the seed is {seed!r}, but it must be a whole number from 0")
    return _made(family, seed, worlds)


def trained_prompts(family: str, seed: int) -> tuple[str, ...]:
    """The phrasings of `trained_task`, in a small part of its time, since no world is drawn.

    Args:
        family: one of `family_names()`, or a file of your own, of which `trained_task` has made a task.
        seed: any number from 0.

    Raises:
        UserError: there is no such family, or its file is wrong.
    """
    template = _template(family_file(family))
    random = template.random(seed)
    return tuple(_phrasings(template, template.chosen(random), random))


@dataclass(frozen=True)
class _Template:
    """A family before names are drawn, and the text of its file."""

    path: Path
    text: str
    file: YamlFile
    form: FamilyFile

    def random(self, seed: int) -> Random:
        """What draws everything of a seed."""
        return Random(f"{self.path.stem} {seed}")  # noqa: S311 - no secret

    def chosen(self, random: Random) -> dict[str, str]:
        """What each name stands for."""
        return dict(_chosen(self.form, self.file, random))


@lru_cache(maxsize=1_024)
def _made(family: str, seed: int, worlds: int) -> TrainedTask:
    template = _template(family_file(family))
    path, random = template.path, template.random(seed)
    chosen = template.chosen(random)
    file = YamlFile(_filled(template.text, chosen, path), path)
    form = file.validate(FamilyFile)
    _expect_python(form, file)
    name = f"{path.stem}-{seed}"
    content = {"name": name, **form.task}
    if isinstance(content.get("prompts"), list):  # else the sentence about it comes when the task is read
        content["prompts"] = [*_phrasings(template, chosen, random)]
    task_file = file.part("task", content)
    head = suite_file()
    rules = head.rules
    task = _without_denial(
        read_task(
            task_file,
            path.with_name(f"{name}.yaml"),
            SKILLS,
            count=worlds,
            seed=seed,
            words=rules.words_for_people,
        )
    )
    digest = hashlib.sha256(f"{head.version} {worlds} {seed} {task_file.data}".encode()).hexdigest()
    suite = Suite(SUITE, head.version, head.about, rules.rules(), {name: task}, digest)
    return TrainedTask(suite, name, form.solution, form.wrong)


def _without_denial(task: Task) -> Task:
    """The task with requirements of which none holds once a program has taken back its report.

    A requirement of its own would hold at first, and so be worth something to programs that are wrong.
    """
    stands = parse(f'not tr.Exists(say(r"{TAKES_BACK}"))', skills=SKILLS)

    def strict(one: Requirement) -> Requirement:
        return replace(one, formula=And((one.formula, stands)))

    scenarios = (replace(one, require=tuple(map(strict, one.require))) for one in task.scenarios)
    return replace(task, scenarios=tuple(scenarios))


# --- what is drawn


def _chosen(form: FamilyFile, file: YamlFile, random: Random) -> Iterator[tuple[str, str]]:
    """What each name in a template stands for."""
    used: set[str] = set()

    def drawn(words: Sequence[str], count: int) -> list[str]:
        left = [word for word in dict.fromkeys(words) if word not in used]
        if len(left) < count:
            raise file.wrong(f"{count} words are to be chosen, but only {len(left)} are left", "choose", name)
        some = random.sample(left, count)
        if any(MARKS.intersection(word) for word in some):
            raise file.wrong("a word contains $, {, } or |, which mark choices", "choose", name)
        used.update(some)
        return some

    for name, choice in form.choose.items():
        if isinstance(choice, list):
            yield from _scalar(name, *drawn(choice, 1))
        elif match := RANGE.fullmatch(choice):
            least, most = int(match[1]), int(match[2])
            if not least <= most < len(NUMBERS):
                raise file.wrong("write the smaller number first, and none above 10", "choose", name)
            number = random.randint(least, most)
            yield from ((name, str(number)), (f"{name}_word", NUMBERS[number]))
        elif match := SOME.fullmatch(choice):
            yield from _list(name, drawn(_pool(match[2], file, name), int(match[1])))
        else:
            yield from _scalar(name, *drawn(_pool(choice, file, name), 1))


def _pool(pool: str, file: YamlFile, name: str) -> list[str]:
    words = _words()
    if pool not in words:
        raise file.wrong(f'there are no "{pool}"; there are {listed(list(words))}', "choose", name)
    return words[pool]


def _scalar(name: str, word: str) -> Iterator[tuple[str, str]]:
    """A word, as it begins a sentence or names somebody, with an article, and of several."""
    article = "an" if word[0] in "aeiou" else "a"
    plural = word + ("es" if word.endswith(("s", "x", "ch", "sh")) else "s")
    yield from ((name, word), (name.capitalize(), word[:1].upper() + word[1:]))
    yield from ((f"a_{name}", f"{article} {word}"), (f"{name}_s", plural))


def _list(name: str, words: list[str]) -> Iterator[tuple[str, str]]:
    """Words for a YAML list, in a sentence, as a list in Python, and one by one."""
    yield from ((name, ", ".join(words)), (f"{name}_and", listed(words)))
    yield f"{name}_quoted", "[" + ", ".join(f'"{word}"' for word in words) + "]"
    for number, word in enumerate(words, 1):
        yield from _scalar(f"{name}_{number}", word)


def _filled(text: str, chosen: Mapping[str, str], path: Path) -> str:
    """A file with what is chosen in place of its names."""
    for match in Template.pattern.finditer(text):
        name = match["named"] or match["braced"]
        if match["escaped"] is None and name not in chosen:
            what = "a dollar stands alone" if name is None else f'"${name}" is not chosen'
            line = text.count("\n", 0, match.start()) + 1
            raise UserError(f"{what}; write $$ for a dollar", file=path, line=line)
    return Template(text).substitute(chosen)


def _expect_python(form: FamilyFile, file: YamlFile) -> None:
    """Raise a UserError if one of the programs does not parse."""
    wrong = [(one.program, ("wrong", number, "program")) for number, one in enumerate(form.wrong)]
    for program, place in ((form.solution, ("solution",)), *wrong):
        if isinstance(flaw := parsed(program), Flaw):
            raise file.wrong(f"this program is no Python: {flaw.message}", *place)


def _phrasings(template: _Template, chosen: Mapping[str, str], random: Random) -> Iterator[Any]:
    """The phrasings with what is chosen, and one word where there were several."""
    for number, prompt in enumerate(template.form.task["prompts"]):
        if not isinstance(prompt, str):  # the sentence about it comes when the task is read
            yield prompt
            continue
        filled = _filled(prompt, chosen, template.path)
        text = " ".join(EITHER.sub(lambda match: random.choice(match[1].split("|")), filled).split())
        if "{" in text or "}" in text:
            raise template.file.wrong(
                "write several words, of which one is taken, as {go|drive}", "task", "prompts", number
            )
        yield text


# --- files


@cache
def _template(path: Path) -> _Template:
    text = read_text(path)
    file = YamlFile(text, path)
    return _Template(path, text, file, file.validate(FamilyFile))


@cache
def _words() -> Mapping[str, list[str]]:
    data = YamlFile.read(FOLDER / "words.yaml").data
    assert isinstance(data, dict)
    return data


@cache
def suite_file() -> SuiteFile:
    """The rules by which tasks of families are judged, and their version."""
    return YamlFile.read(FOLDER / "training.yaml").validate(SuiteFile)
