"""Tasks: prompts, worlds, and what each world requires."""

from __future__ import annotations

import json
import re
from ast import literal_eval
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from codebotler.core.words import counted
from codebotler.core.world import Answer, Person, World
from codebotler.rtl import Formula
from codebotler.rtl.regex_words import first_choice
from roboeval.suites.schema import Ability, Accepted, Category, Fact

_STRINGS = re.compile(r"""r?"(?:\\.|[^"\\])*"|r?'(?:\\.|[^'\\])*'""")


@dataclass(frozen=True)
class Requirement:
    """What the trace of a program must satisfy in a world (paper, section IV.B).

    Args:
        text: as the task file says it, such as `not greets("amy")`.
        check: the name of the check that it applies.
        formula: the constraint, negated where the text says so.
        category: the class of failure if it does not hold.
        line: where it stands in the task file.
        words: by the number of each prompt that asks for it, what it says there; empty if all prompts do.
    """

    text: str
    check: str
    formula: Formula = field(repr=False)
    category: Category
    line: int | None = None
    words: tuple[tuple[int, str], ...] = field(default=(), repr=False)

    def is_asked_by(self, prompt: int) -> bool:
        """Whether a prompt asks for it."""
        return not self.words or any(number == prompt for number, _ in self.words)


@dataclass(frozen=True)
class Scenario:
    """A world and what it requires; with `ablation` only common sense is required of it."""

    world: World
    require: tuple[Requirement, ...]

    def asked_by(self, *prompts: int) -> Scenario:
        """The same with what some of these prompts ask for, and no other requirements."""
        return replace(self, require=tuple(one for one in self.require if any(map(one.is_asked_by, prompts))))

    def __repr__(self) -> str:
        return f"Scenario({self.world!r}, {counted(len(self.require), 'requirement')})"


@dataclass(frozen=True)
class Check:
    """A named constraint of a task.

    Args:
        name: how requirements call it.
        parameters: names of what is put into its text.
        category: the class of failure if it does not hold.
        rtl: the constraint with `{parameter}` where an argument goes.
        commonsense: whether it tests what no prompt says.
        line: where it stands in the task file.
        means: by the kind of event, what its texts come to in a sentence, with `{parameter}` as in `rtl`.
    """

    name: str
    parameters: tuple[str, ...]
    category: Category
    rtl: str
    commonsense: bool
    line: int | None = None
    means: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """One task of a suite: prompts, worlds, requirements (paper, section IV).

    Args:
        name: as rows of completions call it.
        summary: what it is about, in a sentence.
        abilities: what a robot needs for it.
        prompts: phrasings of the same instruction.
        facts: what the requirements rest on.
        covered_by: for facts, the names of the checks that cover each, or why none does.
        checks: the named constraints.
        scenarios: the worlds with their requirements, also those that only some prompts ask for.
        ablation: the same with the requirements of common sense only; None where the task has none.
        accepted: findings of the linter that are there on purpose.
        path: the file it was read from.
        borrows: whether its instruction is that of a task that ships with the package.
        drawn: whether its worlds are drawn from a description.
        phrases: regexes for what can be said in many words, by the name that stands for them in checks.
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
    phrases: tuple[tuple[str, tuple[str, ...]], ...] = ()
    covered_by: tuple[tuple[str, tuple[str, ...] | str], ...] = ()

    def __repr__(self) -> str:
        prompts, worlds = counted(len(self.prompts), "prompt"), counted(len(self.scenarios), "world")
        return f"Task({self.name!r}, {prompts}, {worlds})"

    def judged_in(self, *, ablated: bool = False) -> tuple[Scenario, ...]:
        """The worlds and requirements by which programs are judged; none if there is no ablation."""
        return (self.ablation or ()) if ablated else self.scenarios


def check_label(text: str) -> str:
    """A requirement for people, such as `offers("bread")` for one whose argument is a regex with `bread`."""
    return _STRINGS.sub(
        lambda found: json.dumps(first_choice(literal_eval(found[0])), ensure_ascii=False), text
    )


def world_title(number: int, of: str, about: str) -> str:
    """The title of a world, whose own text may begin with its number where it is drawn."""
    return f"World {number}{of}: {about.removeprefix(f'{number}: ')}"


def describe_person(person: Person) -> str:
    """A person's name, with what they answer and when they come and go."""
    parts = [f"answers {', then '.join(map(_answer, person.answers)) or 'nothing'}"]
    parts += [f"{topic}: {_answer(answer)}" for topic, answer in person.topics]
    if person.after_looks:
        parts.append(f"comes after {person.after_looks} looks without success")
    if person.leaves:
        parts.append("then goes")
    return f"{person.name} ({'; '.join(parts)})"


def _answer(answer: Answer) -> str:
    return answer if isinstance(answer, str) else f"option {answer}"
