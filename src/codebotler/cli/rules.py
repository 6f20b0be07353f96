"""`codebotler rules`: shows each house rule with examples, and warns of likely mistakes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from codebotler.checking.evasions import evasions
from codebotler.checking.rule_review import Review
from codebotler.checking.rules import read_rules
from codebotler.checking.storyboard import grid, steps_of
from codebotler.core.skills.declaration import by_event
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import note, visible
from codebotler.core.trace import Event, Trace
from codebotler.core.words import listed
from codebotler.core.world import World
from codebotler.rtl.wording import done_with
from codebotler.rtl.wording import verb as verb_of
from codebotler.simulator.house_rule import Rule

MADE_UP = ("", "x")  # texts in examples that stand for any other
ASPECTS = {"always": "at any time", "finally": "at the end"}


def rules_for(world: World | None, path: Path | None, skills: SkillTable = SKILLS) -> tuple[Rule, ...]:
    """The rules in a file, if one is named, with remarks on what evades them.

    Raises:
        UserError: they cannot be read, or name a room that the world lacks.
    """
    rules = () if path is None else read_rules(path, skills, rooms_of(world))
    note_evasions(rules, world, skills)
    return rules


def rooms_of(world: World | None) -> list[str]:
    """The names of the rooms of a world; none without one."""
    return [] if world is None else [room.name for room in world.rooms]


def note_evasions(rules: Sequence[Rule], world: World | None, skills: SkillTable) -> None:
    """Say how programs could evade rules; UserError if one cannot hold in the rooms of the world."""
    for sentence in evasions(rules, rooms_of(world), skills):
        note(sentence)


def review_view(found: Sequence[Review]) -> RenderableType:
    """The rules, each with its examples and warnings."""
    parts: list[RenderableType] = []
    for one in found:
        parts += [*_rule(one), Text()]
    return Group(*parts[:-1])


def _rule(one: Review) -> Iterator[RenderableType]:
    rule = one.rule
    refused = "; a program may catch the refusal" if rule.refuse else ""
    yield Text.assemble((rule.name, "bold"), f"  {visible(rule.says)}")
    yield Text(f"  {ASPECTS[rule.when]}{refused}: {rule.formula}", "dim")
    for title, style, trace in (("keeps it", "green", one.keeps), ("breaks it", "red", one.breaks)):
        if trace is not None:
            yield Text(f"  {title}", style)
            yield Padding(steps_view(trace), (0, 0, 0, 4))
    for warning in one.warnings:
        yield Text(f"  note: {warning}", "yellow")


def steps_view(trace: Trace) -> RenderableType:
    """The steps of an example, numbered."""
    table = grid("right", "left")
    if not trace:
        table.add_row(Text(), Text("the robot does nothing", "dim"))
    here = ""
    for number, event in enumerate(trace, 1):
        table.add_row(Text(str(number), "dim"), Text(step_sentence(event, here)))
        here = event.text if is_drive(event) else event.place
    return table


def is_drive(event: Event) -> bool:
    """Whether an event takes the robot to another room."""
    row = by_event(event.kind)
    return row is not None and row.is_drive


def step_sentence(event: Event, here: str = "") -> str:
    """A step of an example, with all that a rule may speak of; any text will do where it is made up.

    Args:
        event: the step.
        here: the room that the steps before it tell; a drive from another one says so.
    """
    verb, drives = verb_of(event.kind), is_drive(event)
    made_up = "another room" if drives else "something"
    quote = "" if verb.object else '"'
    given = [made_up if t in MADE_UP else f"{quote}{visible(t)}{quote}" for t in (event.text, *event.more)]
    told = [done_with(event.kind, verb.third, given, "")]
    offered = [f'"{visible(option.text)}"' for option in event.options if option.text not in MADE_UP]
    more = len(event.options) - len(offered)
    offered += [f"{more} {'more' if offered else 'options'}"] if more > 1 else []
    told += [f"offering {listed(offered)}"] if offered else []
    told += [f'of "{visible(event.to)}"'] if event.to and event.to not in MADE_UP else []
    where = "from" if drives else "in"
    is_told = event.place in MADE_UP or (drives and event.place == here)
    told += [] if is_told else [f"{where} {visible(event.place)}"]
    held = "something" if event.holding in MADE_UP else f'"{visible(event.holding)}"'
    told += [f"holding {held}"] if event.holding else []
    if event.found is not None:
        told.append(f"and {'finds it' if event.found else 'does not find it'}")
    told += [f'and hears "{visible(event.answer)}"'] if event.answer is not None else []
    return " ".join(told)


def review_data(found: Sequence[Review]) -> list[dict[str, object]]:
    """The same as plain data."""
    return [
        {
            "name": one.rule.name,
            "says": one.rule.says,
            "when": one.rule.when,
            "formula": str(one.rule.formula),
            "refuse": one.rule.refuse,
            "keeps": None if one.keeps is None else steps_of(one.keeps),
            "breaks": None if one.breaks is None else steps_of(one.breaks),
            "warnings": list(one.warnings),
        }
        for one in found
    ]
