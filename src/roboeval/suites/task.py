"""Tasks: prompts, worlds, and requirements."""

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
from roboeval.suites.schema import Ability, AcceptedFinding, Category, TaskFact

_STRINGS = re.compile(r"""r?"(?:\\.|[^"\\])*"|r?'(?:\\.|[^'\\])*'""")


@dataclass(frozen=True)
class Requirement:
    """A formula that the trace of a program must satisfy in a world (paper, section IV.B).

    Args:
        words: the number of each prompt that asks for it, and its words; empty if all prompts do.
    """

    text: str  # the text in the task file, such as `not greets("amy")`
    check: str  # the name of the check that it applies
    formula: Formula = field(repr=False)  # the formula, negated if the text starts with `not`
    category: Category  # the kind of failure if it does not hold
    line: int | None = None  # the line in the task file
    words: tuple[tuple[int, str], ...] = field(default=(), repr=False)

    def is_asked_by(self, prompt: int) -> bool:
        """Whether a prompt asks for it."""
        return not self.words or any(number == prompt for number, _ in self.words)


@dataclass(frozen=True)
class Scenario:
    """A world with its requirements."""

    world: World
    require: tuple[Requirement, ...]

    def asked_by(self, *prompts: int) -> Scenario:
        """Keep only the requirements that one of these prompts asks for."""
        return replace(self, require=tuple(one for one in self.require if any(map(one.is_asked_by, prompts))))

    def __repr__(self) -> str:
        return f"Scenario({self.world!r}, {counted(len(self.require), 'requirement')})"


@dataclass(frozen=True)
class TaskCheck:
    """A named formula of a task that requirements apply.

    Args:
        means: descriptions of its texts for explanations, by kind of event, with `{parameter}` as in `rtl`.
    """

    name: str  # the name in requirements
    parameters: tuple[str, ...]  # the names of its parameters
    category: Category  # the kind of failure if it does not hold
    rtl: str  # the formula, with `{parameter}` in place of arguments
    commonsense: bool  # whether it tests something that no prompt mentions
    line: int | None = None  # the line in the task file
    means: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """One task of a suite: prompts, worlds, requirements (paper, section IV).

    Args:
        covered_by: the checks that cover each fact, or the reason why none does.
        scenarios: the worlds with all requirements, including those that only some prompts ask for.
        ablation: the worlds with common-sense requirements only; None if the task has none.
        phrases: regexes for equivalent phrasings, by their name in checks.
    """

    name: str  # the name in rows of completions
    summary: str  # a description in a sentence
    abilities: tuple[Ability, ...]  # the abilities that a robot needs
    prompts: tuple[str, ...]  # phrasings of the same instruction
    facts: tuple[TaskFact, ...]  # the facts that requirements depend on
    checks: tuple[TaskCheck, ...]  # the named formulas
    scenarios: tuple[Scenario, ...]
    ablation: tuple[Scenario, ...] | None
    accepted: tuple[AcceptedFinding, ...]  # intended findings of the linter
    path: Path  # the task file
    borrows: bool = False  # whether its instruction comes from a task of another suite
    is_sampled: bool = False  # whether its worlds are sampled from a description
    phrases: tuple[tuple[str, tuple[str, ...]], ...] = ()
    covered_by: tuple[tuple[str, tuple[str, ...] | str], ...] = ()

    def __repr__(self) -> str:
        prompts, worlds = counted(len(self.prompts), "prompt"), counted(len(self.scenarios), "world")
        return f"Task({self.name!r}, {prompts}, {worlds})"

    def judged_in(self, *, ablated: bool = False) -> tuple[Scenario, ...]:
        """The worlds and requirements that judge programs; empty if an ablation is missing."""
        return (self.ablation or ()) if ablated else self.scenarios


def check_label(text: str) -> str:
    """Shorten a requirement for people: replace regexes by an example, as in `offers("bread")`."""
    return _STRINGS.sub(
        lambda found: json.dumps(first_choice(literal_eval(found[0])), ensure_ascii=False), text
    )


def world_title(number: int, of: str, about: str) -> str:
    """The title of a world; the number at the start of a sampled world's description is dropped."""
    return f"World {number}{of}: {about.removeprefix(f'{number}: ')}"


def describe_person(person: Person) -> str:
    """Describe a person: name, answers, and when they arrive and leave."""
    parts = [f"answers {', then '.join(map(_answer, person.answers)) or 'nothing'}"]
    parts += [f"{topic}: {_answer(answer)}" for topic, answer in person.topics]
    if person.after_looks:
        parts.append(f"arrives after {person.after_looks} unsuccessful looks")
    if person.leaves:
        parts.append("then leaves")
    return f"{person.name} ({'; '.join(parts)})"


def _answer(answer: Answer) -> str:
    return answer if isinstance(answer, str) else f"option {answer}"
