"""`codebotler rules`: show house rules with examples, and warn about likely mistakes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from codebotler.checking.house_rules.file import read_rules
from codebotler.checking.house_rules.review import Review
from codebotler.checking.house_rules.rooms import find_evasions
from codebotler.checking.storyboard import grid, steps_of
from codebotler.core.skills.declaration import by_event
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import note, visible
from codebotler.core.text.phrases import phrase
from codebotler.core.trace import Event, Trace
from codebotler.core.world import World
from codebotler.simulator.guard.house_rule import Rule

ANY_ARGUMENT = ("", "x")  # in examples, these mean any text, which is shown as "…"
WHEN_WORDS = {
    "always": "at any time",
    "leaving": "when the robot leaves a room, and at the end",
    "finally": "at the end",
}


def rules_for(world: World | None, path: Path | None, skills: SkillTable = SKILLS) -> tuple[Rule, ...]:
    """Read a rules file, if given, and warn if rules can be evaded. Raise UserError if a rule is invalid."""
    rules = () if path is None else read_rules(path, skills, rooms_of(world))
    for sentence in find_evasions(rules, rooms_of(world), skills):
        note(sentence)
    return rules


def rooms_of(world: World | None) -> list[str]:
    """Return the names of the rooms in a world, or an empty list without a world."""
    return [] if world is None else [room.name for room in world.rooms]


def review_view(found: Sequence[Review]) -> RenderableType:
    """Return rules with their examples and warnings, for printing."""
    parts: list[RenderableType] = []
    for one in found:
        parts += [*_rule(one), Text()]
    return Group(*parts[:-1])


def _rule(one: Review) -> Iterator[RenderableType]:
    rule = one.rule
    refused = "; programs may catch the refusal" if rule.refuse else ""
    yield Text.assemble((rule.name, "bold"), f"  {visible(rule.says)}")
    yield Text(f"  {WHEN_WORDS[rule.when]}{refused}: {rule.formula}", "dim")
    for title, style, trace in (("keeps it", "green", one.keeps), ("breaks it", "red", one.breaks)):
        if trace is not None:
            yield Text(f"  {title}", style)
            yield Padding(steps_view(trace), (0, 0, 0, 4))
    for warning in one.warnings:
        yield Text(f"  note: {warning}", "yellow")


def steps_view(trace: Trace) -> RenderableType:
    """Return a table with the steps of an example, numbered from 1."""
    table = grid("right", "left")
    if not trace:
        table.add_row(Text(), Text("the robot does nothing", "dim"))
    room = ""
    for number, event in enumerate(trace, 1):
        table.add_row(Text(str(number), "dim"), Text(step_sentence(event, room)))
        room = event.text if is_drive(event) else event.place
    return table


def is_drive(event: Event) -> bool:
    """Return whether an event takes the robot to another room."""
    row = by_event(event.kind)
    return row is not None and row.is_drive


def step_sentence(event: Event, room: str = "") -> str:
    """Return a step in words: `drives to "kitchen" from office`, without `from office` if that is `room`."""

    def show(text: str) -> str:
        return "…" if text in ANY_ARGUMENT else visible(text)

    drives = is_drive(event)
    parts = [phrase(event, "third", show=show)]
    parts += [f'of "{visible(event.to)}"'] if event.to and event.to not in ANY_ARGUMENT else []
    is_known = event.place in ANY_ARGUMENT or (drives and event.place == room)
    parts += [] if is_known else [f"{'from' if drives else 'in'} {visible(event.place)}"]
    parts += [f'holding "{show(event.holding)}"'] if event.holding else []
    parts += [f'and hears "{visible(event.answer)}"'] if event.answer is not None else []
    return " ".join(parts)


def review_data(found: Sequence[Review]) -> list[dict[str, object]]:
    """Return data for JSON: rules with their examples and warnings."""
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
