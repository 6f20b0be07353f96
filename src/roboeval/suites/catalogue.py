"""A suite's tasks for people to read, and the start of a new one."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console, ConsoleOptions, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from codebotler.badinput import BadInput
from codebotler.files import write_whole
from codebotler.world import Answer, Person, World
from roboeval.suites.installed import installed_suites
from roboeval.suites.load import ABLATED, Scenario, Suite, Task, load_suite, shipped_suites


def suite_view(suite: Suite) -> RenderableType:
    """All tasks, one a row."""
    table = Table(box=None, padding=(0, 2, 0, 0), show_edge=False)
    table.add_column("task", no_wrap=True)
    table.add_column("worlds", justify="right")
    table.add_column("prompts", justify="right")
    table.add_column("what is asked")
    for task in suite.tasks.values():
        table.add_row(
            Text(task.name, "bold"), str(len(task.scenarios)), str(len(task.prompts)), Text(task.summary)
        )
    return Group(Text(f"{suite.name}: {suite.about}"), Text(), table)


def task_view(task: Task) -> RenderableType:
    """One task: its phrasings, its checks, and what each world requires."""
    parts: list[RenderableType] = [
        Text.assemble((task.name, "bold"), f"  {task.summary}"),
        Text(f"takes {', '.join(task.abilities)}", "dim"),
    ]
    parts += _section("Prompts", [Text(f"{n}  {prompt}") for n, prompt in enumerate(task.prompts)])
    parts += _section("Facts", [_fact(fact.fact, commonsense=fact.commonsense) for fact in task.facts])
    parts += _section("Checks", [_check(task, index) for index in range(len(task.checks))])
    if task.phrases:
        several = [
            Text.assemble((f"{{{name}}}", "bold"), f"  {', '.join(regexes)}")
            for name, regexes in task.phrases
        ]
        parts += _section("Phrases in checks", several)
    for number, scenario in enumerate(task.scenarios, 1):
        parts += _section(f"World {number}: {scenario.world.about}", _world_lines(scenario))
    return Group(*parts)


def _section(title: str, lines: Sequence[RenderableType]) -> list[RenderableType]:
    return [Text(), Text(title, "bold"), *(Padding(line, (0, 0, 0, 2)) for line in lines)]


def _fact(fact: str, *, commonsense: bool) -> Text:
    return Text(f"{fact}{' (common sense: no prompt says it)' if commonsense else ''}")


def _check(task: Task, index: int) -> RenderableType:
    check = task.checks[index]
    head = check.name + (f"({', '.join(check.parameters)})" if check.parameters else "")
    formula = _Formula(" ".join(check.rtl.split()), "dim")
    return Group(Text.assemble((head, "bold"), f"  {check.category}"), Padding(formula, (0, 0, 0, 2)))


@dataclass(frozen=True)
class _Formula:
    """A formula that is broken into lines where no text of it is torn."""

    text: str
    style: str = ""

    def __rich_console__(self, _: Console, options: ConsoleOptions) -> Iterator[Text]:
        line = ""
        for part in _UNTORN.findall(self.text):
            if line and len((line + part).rstrip()) > options.max_width:
                yield Text(line.rstrip(), self.style)
                line = ""
            line += part
        yield Text(line, self.style)


_UNTORN = re.compile(r"""(?:r?"(?:\\.|[^"\\])*"|r?'(?:\\.|[^'\\])*'|[^\s"'(]+|\S)[(),]*\s*""")


def _world_lines(scenario: Scenario) -> list[RenderableType]:
    world = scenario.world
    lines: list[RenderableType] = [_room(world, index) for index in range(len(world.rooms))]
    if world.may_wait_forever:
        lines.append(Text("a program may wait here for ever", "italic"))
    return [*lines, *(_Formula(f"requires {requirement.text}") for requirement in scenario.require)]


def _room(world: World, index: int) -> Text:
    room = world.rooms[index]
    who = [person_told(person) for person in room.people]
    there = [*room.objects, *who, *(["the robot"] if room.name == world.robot else [])]
    return Text(f"{room.name}: {', '.join(there) or 'nobody and nothing'}")


def person_told(person: Person) -> str:
    """Somebody, with what they answer and when they come and go."""
    told = [f"answers {', then '.join(map(_answer, person.answers)) or 'nothing'}"]
    told += [f"{topic}: {_answer(answer)}" for topic, answer in person.topics]
    if person.after_looks:
        told.append(f"comes after {person.after_looks} looks in vain")
    if person.leaves:
        told.append("then goes")
    return f"{person.name} ({'; '.join(told)})"


def _answer(answer: Answer) -> str:
    return answer if isinstance(answer, str) else f"option {answer}"


def suite_data(suite: Suite, only: str | None = None) -> dict[str, Any]:
    """A suite for machines.

    Args:
        suite: to be told.
        only: the name of a task; all by default.
    """
    return {
        "suite": suite.name,
        "version": suite.version,
        "digest": suite.digest,
        "tasks": [
            {
                "task": task.name,
                "summary": task.summary,
                "abilities": list(task.abilities),
                "prompts": list(task.prompts),
                "worlds": [scenario.world.about for scenario in task.scenarios],
                "ablation": task.ablation is not None,
            }
            for task in suite.tasks.values()
            if only in {None, task.name}
        ],
    }


def new_task(folder: Path, name: str) -> Path:
    """Start a task in a suite's folder, and the suite if there is none; the files say what to fill in.

    Solutions come with it, unless there are some for a task of this name already.

    Args:
        folder: of the suite.
        name: of the task.

    Raises:
        BadInput: the name cannot be one, the task is there already, or the folder cannot be written or lies
            within another suite.
    """
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", name):
        raise BadInput(
            f'"{name}" is no name for a task; write words together, each with a capital, such as WaterPlants'
        )
    around = folder.resolve().parent
    if (around / "suite.yaml").exists():
        raise BadInput("lies within a suite; name the folder around it", file=folder)
    path = folder / "tasks" / f"{name}.yaml"
    if path.exists():
        raise BadInput("is there already; choose another name, or edit it", file=path)
    try:
        if not (folder / "suite.yaml").exists():
            write_whole(folder / "suite.yaml", SUITE.replace("NAME", _suite_name(folder)).encode())
        if not (solutions := folder / "solutions" / f"{name}.yaml").exists():
            write_whole(solutions, SOLUTIONS.encode())
        write_whole(path, TEMPLATE.replace("NAME", name).encode())
    except OSError as error:
        raise BadInput(f"cannot be written ({error.strerror})", file=error.filename) from None
    return path


def _suite_name(folder: Path) -> str:
    """A name for the suite in a folder: the folder's, as far as it can be one."""
    name = (
        re.sub(r"[^a-z0-9-]", "-", folder.resolve().name.lower()).lstrip("-0123456789").removesuffix(ABLATED)
    )
    return f"my-{name}" if name in shipped_suites() else name or "mine"


def expect_own(suite: str) -> None:
    """Refuse to start a task in a suite that is somebody else's.

    Args:
        suite: its name, or the folder of one that is one's own.

    Raises:
        BadInput: it ships with RoboEval, or a package brings it.
    """
    brought = [one.package for one in installed_suites() if one.name == suite]
    if suite in shipped_suites() or brought:
        whose = f"belongs to the package {brought[0]}" if brought else "ships with RoboEval"
        raise BadInput(
            f'the suite "{suite}" {whose} and stays as it is; name a folder of your own with --suite'
        )


def other_suites(name: str) -> Iterator[str]:
    """What else --suite takes, in a sentence, and one for each suite of a package that cannot be had.

    Args:
        name: of the suite that is known already.
    """
    shipped = shipped_suites()
    others = [one for one in shipped if one != name]
    for suite in installed_suites():
        try:
            if suite.name in shipped:
                raise BadInput(  # noqa: TRY301 - told like all else
                    f'the package {suite.package} names a suite "{suite.name}", as one is named that ships '
                    "with RoboEval, so that nobody can ask for it; rename it there"
                )
            load_suite(suite.name)
        except BadInput as error:
            yield str(error)
        else:
            others += [f"{suite.name} ({suite.package})"] * (suite.name != name)
    if others:
        yield f"other suites, by --suite: {', '.join(others)}; or the folder of your own"


SUITE = """\
name: NAME                # by this name evaluations are kept; small letters, digits and dashes
version: 1                # count it up when a verdict may change
about: my tasks
"""

TEMPLATE = """\
name: NAME
summary: Tell whoever is in the kitchen that tea is ready.
abilities: [navigation, perception, announcement]

prompts:                  # the same instruction in several phrasings
  - >-
    Go to the kitchen. If somebody is there, say "tea is ready".

facts:                    # what the requirements rest on; every prompt says each in one of these words
  - fact: the kitchen is where to go
    words: [kitchen]
  - fact: what is said is that tea is ready
    words: [tea is ready]

checks:                   # RTL; {parameters} are filled in where a world requires the check
  visits(room):
    category: Location
    rtl: >-
      tr.Exists(goto("{room}"))
  announces_tea:
    category: SayAtLocation
    rtl: >-
      tr.ActAtFirst("kitchen", say(words("tea", "ready")))

worlds:
  - about: somebody is in the kitchen
    robot: start_loc
    rooms: [kitchen, start_loc]
    people:
      kitchen: [{name: kim, answers: ["yes"]}]
    require:              # that the kitchen is visited follows from this, so it is not required once more
      - announces_tea
  - about: nobody is in the kitchen
    robot: start_loc
    rooms: [kitchen, start_loc]
    require:
      - visits("kitchen")
      - not announces_tea
"""

SOLUTIONS = """\
# Right and wrong programs: `roboeval tasks --lint` says which requirement no wrong one trips.
programs:
  - about: looks first
    program: |
      def task_program():
          go_to("kitchen")
          if is_in_room("person"):
              say("tea is ready")
  - about: says it whether or not somebody is there
    fails: SayAtLocation
    program: |
      def task_program():
          go_to("kitchen")
          say("tea is ready")
  - about: only says it where it starts
    fails: SayAtLocation
    program: |
      def task_program():
          say("tea is ready")
"""
