"""`codebotler skills`: show skills as models see them, try them out, and write a template."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.syntax import Syntax
from rich.text import Text

from codebotler.core.errors import RobotError, UserError
from codebotler.core.program import literal, parse_expression
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.terminal import visible
from codebotler.core.text.phrases import phrase
from codebotler.core.text.words import listed
from codebotler.core.trace import Event, Option
from codebotler.prompts.rendering import stub
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_robot import SampledRobot

WORLD_COUNT = 40  # the number of sampled worlds to try each skill in
PROMPT_EXAMPLE_ROOMS = RoomMap(("room", "start_loc"), "start_loc", guessed=True)
SKILLS_TEMPLATE = Path(__file__).with_name("new-skills.txt").read_text()


@dataclass(frozen=True)
class SkillTrial:
    """One outcome of a skill's example call, such as `returns True`, and the facts of a world that had it."""

    outcome: str  # the outcome as a phrase, such as `returns True`
    facts: tuple[str, ...]  # the facts in the first world with this outcome
    event: Event | None  # the recorded event, if there is one


def write_new(path: Path, text: str) -> None:
    """Write a new file, or raise UserError if it already exists."""
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UserError("the file already exists; choose another name", file=path) from None


def try_skill(row: Skill, skills: SkillTable) -> list[SkillTrial]:
    """Call a skill with its example in 40 sampled worlds, and return each different outcome once."""
    arguments = _example(row)
    found: dict[str, SkillTrial] = {}
    earlier = [one for one in skills.rows[: skills.rows.index(row)] if one not in SKILLS.rows]
    for number in range(WORLD_COUNT):
        robot = SampledRobot(PROMPT_EXAMPLE_ROOMS, FactSampler(0, number), skills=skills)
        for one in earlier if number % 2 else ():  # the skill may depend on the effects of earlier skills
            with suppress(RobotError):
                robot.perform(one.name, _example(one))
        try:
            result: Any = robot.perform(row.name, arguments)
            options = [given for given, one in zip(arguments, row.parameters, strict=True) if one.is_options]
            result = options[0][result].text if options else result
            outcome = "works" if result is None else f"returns {result!r}"
        except RobotError as error:
            outcome = f"fails with {error.kind}: {str(error).removeprefix(f'{row.name}: ')}"
        event = robot.trace[-1] if robot.trace else None
        facts = tuple(fact.sentence for fact in robot.facts if fact.names[0] != row.call)
        found.setdefault(outcome, SkillTrial(outcome, facts, event))
    return list(found.values())


def _example(row: Skill) -> list[Any]:
    """Return the arguments of a skill's example in order, or raise UserError if the example is invalid."""
    node = parse_expression(row.call)
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == row.name):
        row.wrong(f"the example of {row.name} is not a call of {row.name}: {row.call}")
    named = {keyword.arg: keyword.value for keyword in node.keywords}
    given: list[Any] = []
    for number, parameter in enumerate(row.parameters):
        value = node.args[number] if number < len(node.args) else named.get(parameter.name)
        try:
            example = None if value is None else literal(value)
        except ValueError:
            example = None
        if example is None or not parameter.type.fits(example):
            row.wrong(f"{parameter.name} in the example of {row.name} must be {parameter.in_words}")
        if parameter.is_options:
            example = [Option(text) for text in example]
        given.append(tuple(example) if isinstance(example, list) else example)
    return given


def skills_view(skills: SkillTable) -> RenderableType:
    """Return the custom skills (or the built-in ones if there are none) as models see them, with outcomes."""
    own = [row for row in skills.rows if row not in SKILLS.rows]
    return Group(*_lines(own or SKILLS.rows, skills))


def _lines(rows: Sequence[Skill], skills: SkillTable) -> Iterator[RenderableType]:
    for number, row in enumerate(rows):
        yield Text("\n" if number else "", end="")
        yield Syntax(stub(row), "python", theme="ansi_dark", background_color="default", word_wrap=True)
        for trial in try_skill(row, skills):
            where = f", where {listed(trial.facts)}" if trial.facts else ""
            yield Text(visible(f"  {row.call} {trial.outcome}{where}"), "dim")
            if trial.event is not None and not trial.outcome.startswith("fails"):
                yield Text(visible(f"    in words: {phrase(trial.event, 'past')}"), "dim")


def skills_data(skills: SkillTable) -> list[dict[str, Any]]:
    """Return data for JSON: the skills, each with the outcomes of its example."""
    return [
        {
            "name": row.name,
            "signature": row.signature,
            "doc": row.doc,
            "example": row.call,
            "fails": dict(row.fails),
            "tried": [{"outcome": one.outcome, "facts": list(one.facts)} for one in try_skill(row, skills)],
        }
        for row in skills.rows
    ]
