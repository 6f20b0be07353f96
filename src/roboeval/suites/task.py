"""Defines tasks, which consist of prompts, worlds and requirements."""

from __future__ import annotations

import json
import re
from ast import literal_eval
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from codebotler.core.text.words import counted
from codebotler.core.world import Answer, Person, Room, World
from codebotler.rtl import Formula
from codebotler.rtl.regex_words import first_choice
from roboeval.suites.schema import Ability, AcceptedFinding, Category, TaskFact

_STRINGS = re.compile(r"""r?"(?:\\.|[^"\\])*"|r?'(?:\\.|[^'\\])*'""")


@dataclass(frozen=True)
class Requirement:
    """A formula that the trace of a program must satisfy in a world (paper, section IV.B).

    Args:
        words: pairs of a prompt's number and the words in it that ask for this; empty if all prompts ask.
        arguments: the values for the check's parameters, such as `amy` in `greets("amy")`.
    """

    text: str  # the requirement in the task file, such as `not greets("amy")`
    check: str  # the name of the check
    formula: Formula = field(repr=False)  # the check's formula, negated if the text starts with `not`
    category: Category  # the kind of failure if the formula does not hold
    line: int | None = None  # the line in the task file
    words: tuple[tuple[int, str], ...] = field(default=(), repr=False)
    arguments: tuple[str, ...] = field(default=(), repr=False)

    def is_asked_by(self, prompt: int) -> bool:
        """Return whether the prompt with this number, from 0, asks for this requirement."""
        return not self.words or any(number == prompt for number, _ in self.words)


@dataclass(frozen=True)
class Scenario:
    """A world and the requirements that a program must satisfy in it."""

    world: World
    require: tuple[Requirement, ...]

    def asked_by(self, *prompts: int) -> Scenario:
        """Return the scenario with only the requirements that at least one of these prompts asks for."""
        return replace(self, require=tuple(one for one in self.require if any(map(one.is_asked_by, prompts))))

    def __repr__(self) -> str:
        return f"Scenario({self.world!r}, {counted(len(self.require), 'requirement')})"


@dataclass(frozen=True)
class TaskCheck:
    """A named formula in a task, such as `asks_in(room)`. Requirements call it with arguments.

    Args:
        means: by kind of event, what its regex means, as shown in explanations; may contain `{parameter}`.
    """

    name: str  # the name that requirements use
    parameters: tuple[str, ...]  # the names of the parameters
    category: Category  # the kind of failure if it does not hold
    rtl: str  # the formula with `{parameter}` in place of arguments
    commonsense: bool  # whether the check tests something that no prompt mentions
    line: int | None = None  # the line in the task file
    means: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """A task of a suite: prompts, worlds and requirements (paper, section IV).

    Args:
        covered_by: the checks that cover each fact, or the reason why none does.
        scenarios: the worlds with all requirements, including requirements of only some prompts.
        ablation: the worlds with only common-sense requirements, or None if the task has no ablation.
        phrases: regexes for equivalent phrasings, by the name that checks use.
    """

    name: str  # the name in completions
    summary: str  # a one-sentence description
    abilities: tuple[Ability, ...]  # the abilities a robot needs for the task
    prompts: tuple[str, ...]  # phrasings of the same instruction
    facts: tuple[TaskFact, ...]  # the facts that requirements depend on
    checks: tuple[TaskCheck, ...]  # the named formulas
    scenarios: tuple[Scenario, ...]
    ablation: tuple[Scenario, ...] | None
    accepted: tuple[AcceptedFinding, ...]  # intended findings of the linter
    path: Path  # the task file
    borrows: bool = False  # whether the instruction is borrowed from another suite
    is_sampled: bool = False  # whether the worlds are sampled from a description
    phrases: tuple[tuple[str, tuple[str, ...]], ...] = ()
    covered_by: tuple[tuple[str, tuple[str, ...] | str], ...] = ()

    def __repr__(self) -> str:
        prompts, worlds = counted(len(self.prompts), "prompt"), counted(len(self.scenarios), "world")
        return f"Task({self.name!r}, {prompts}, {worlds})"

    def judged_in(self, *, ablated: bool = False) -> tuple[Scenario, ...]:
        """Return the worlds to judge programs in. If `ablated`, return those of the ablation, or ()."""
        return (self.ablation or ()) if ablated else self.scenarios


def plain_check(text: str) -> str:
    """Replace regexes in a requirement by examples: `offers("bread|loaf")` gives `offers("bread")`."""
    return _STRINGS.sub(
        lambda found: json.dumps(first_choice(literal_eval(found[0])), ensure_ascii=False), text
    )


def world_title(number: int, total: int | None, about: str) -> str:
    """Return the title of a world, such as `World 2 of 9: nobody is in the lab`.

    The title has no number if `total` is 1 (for an agent's mission), and no total if `total` is None.
    """
    which = "" if total == 1 else f" {number}" if total is None else f" {number} of {total}"
    return f"World{which}: {about.removeprefix(f'{number}: ')}"


def describe_contents(world: World, room: Room) -> list[str]:
    """Describe each thing and person in a room or at a place, such as `cup` and `Amy (answers yes)`."""
    traits = {
        name: [f"{key} {', '.join(value) if isinstance(value, tuple) else value}" for key, value in of]
        for name, of in world.traits
    }
    things = [f"{one} ({', '.join(traits[one])})" if one in traits else one for one in room.objects]
    return [*things, *(_describe_person(one, traits.get(one.name, [])) for one in room.people)]


def _describe_person(person: Person, traits: Sequence[str]) -> str:
    parts = [*traits, f"answers {', then '.join(map(_answer, person.answers)) or 'nothing'}"]
    parts += [f"{topic}: {_answer(answer)}" for topic, answer in person.topics]
    if person.after_looks:
        parts.append(f"arrives after {person.after_looks} unsuccessful looks")
    if person.leaves:
        parts.append("then leaves")
    return f"{person.name} ({'; '.join(parts)})"


def _answer(answer: Answer) -> str:
    return answer if isinstance(answer, str) else f"option {answer}"
