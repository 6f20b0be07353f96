"""Formats a suite's tasks, and a single task with its checks and worlds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from codebotler.core.text.words import listed
from roboeval.suites.load import Scenario, Suite, Task, TaskCheck
from roboeval.suites.task import describe_contents, world_title


def suite_view(suite: Suite) -> RenderableType:
    """Return a table for the terminal with one row for each task of a suite."""
    table = Table(box=None, padding=(0, 2, 0, 0), show_edge=False)
    table.add_column("task", no_wrap=True)
    table.add_column("worlds", justify="right")
    table.add_column("prompts", justify="right")
    table.add_column("what is asked")
    for task in suite.tasks.values():
        worlds, prompts = len(task.scenarios), len(task.prompts)
        table.add_row(Text(task.name, "bold"), str(worlds), str(prompts), Text(task.summary))
    return Group(Text(f"{suite.name}: {suite.about}"), Text(), table)


def suite_task_view(task: Task) -> RenderableType:
    """Return a view of a task: its prompts, its checks, and the requirements of each world."""
    parts: list[RenderableType] = [
        Text.assemble((task.name, "bold"), f"  {task.summary}"),
        Text(f"needs {', '.join(task.abilities)}", "dim"),
    ]
    common = " (common sense: no prompt states it)"
    parts += _section("Prompts", [Text(f"{n}  {prompt}") for n, prompt in enumerate(task.prompts)])
    parts += _section("Facts", [Text(fact.fact + common * fact.commonsense) for fact in task.facts])
    parts += _section("Checks", [*map(_check_view, task.checks)])
    phrases = [Text.assemble((f"{{{name}}}", "bold"), f"  {', '.join(each)}") for name, each in task.phrases]
    parts += _section("Phrases in checks", phrases) if phrases else []
    for number, scenario in enumerate(task.scenarios, 1):
        parts += _section(world_title(number, None, scenario.world.about), _world_lines(scenario))
    return Group(*parts)


def _section(title: str, lines: Iterable[RenderableType]) -> list[RenderableType]:
    return [Text(), Text(title, "bold"), *(Padding(line, (0, 0, 0, 2)) for line in lines)]


def _check_view(check: TaskCheck) -> RenderableType:
    head = check.name + (f"({', '.join(check.parameters)})" if check.parameters else "")
    formula = Text(" ".join(check.rtl.split()), "dim")
    return Group(Text.assemble((head, "bold"), f"  {check.category}"), Padding(formula, (0, 0, 0, 2)))


def _world_lines(scenario: Scenario) -> Iterator[RenderableType]:
    world = scenario.world
    for room in world.rooms:
        there = describe_contents(world, room)
        there += ["the robot"] if room.name == world.robot else []
        yield Text(f"{room.name}: {', '.join(there) or 'empty'}")
    if world.may_wait_forever:
        yield Text("a program may wait for ever in this world", "italic")
    for requirement in scenario.require:
        asked = listed([str(prompt) for prompt, _ in requirement.words], "or")
        yield Text(f"requires {requirement.text}{asked and f' for prompt {asked}'}")
