"""Missions and robots as a person sees them: as they go on, in a list, one by one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from types import TracebackType
from typing import Self

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from codebotler.checking.storyboard import grid
from codebotler.core.pasted import mission_command
from codebotler.core.skills import SKILLS
from codebotler.core.terminal import console, shortened, visible
from codebotler.missions.live import in_words
from codebotler.missions.log import Line, Summary
from codebotler.missions.mission import State
from codebotler.robots.base import Readiness

STYLES: Mapping[State, str] = {
    State.DONE: "bold green",
    State.FAILED: "bold red",
    State.STOPPED: "bold yellow",
    State.INTERRUPTED: "bold red",
}
FOUND = {True: "found", False: "not found"}
LATEST = 999_999.95  # seconds that are written out, in ten characters with their unit
CLEAR = "\r\x1b[2K"


class Watcher:
    """Prints what a robot does as it happens; on a terminal, how a skill goes on takes one line only.

    Args:
        summary: of the mission.
    """

    def __init__(self, summary: Summary) -> None:
        self._console = console(highlight=False)
        self._is_half = False
        self._console.print()
        self._console.print(Text.assemble(("running", "bold"), f" on the robot {summary.robot}"))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end_line()

    def __call__(self, line: Line) -> None:
        """Print an event."""
        text = told(line)
        if text is None or line["event"] == "state":
            return
        passing = line["event"] == "feedback" and self._console.is_terminal
        self._end_line()
        time = Text(f"{_at(line):>10}  " if line["event"] in {"skill", "sleep"} else " " * 12, "dim")
        self._console.print(time + text, end="" if passing else "\n", soft_wrap=True)
        self._console.file.flush()
        self._is_half = passing

    def _end_line(self) -> None:
        if self._is_half:
            self._console.file.write(CLEAR)
            self._is_half = False


def _at(line: Line) -> str:
    """When it was, by the robot's clock."""
    clock = float(line["clock"])
    return f"{clock:.1f} s" if clock < LATEST else f"{clock:.1e} s"


def told(line: Line) -> Text | None:
    """An event in words; None if there is nothing to tell a person."""
    words = WORDS.get(line["event"])
    return words(line) if words else None


def _skill(line: Line) -> Text:
    name, arguments = line["skill"], line["arguments"]
    skill = SKILLS.get(name)
    if skill is None or skill.verb is None:
        return Text(shortened(in_words(name, list(arguments.values()))))
    recording = skill.recording
    if recording is None:
        return Text(skill.verb.third)
    words = f'{skill.verb.third} "{shortened(str(arguments[recording.text]))}"'
    if recording.options:
        words += f" [{shortened(' | '.join(arguments[recording.options]))}]"
    return Text(words, "bold" if recording.kind == "goto" else "")


def _result(line: Line) -> Text | None:
    result = line["result"]
    if result is None:
        return None
    if isinstance(result, bool) and line["skill"] == "is_in_room":
        return Text(f"→ {FOUND[result]}")
    return Text(f"→ {shortened(', '.join(map(str, result)) if isinstance(result, list) else str(result))}")


def _state(line: Line) -> Text:
    reason = f": {shortened(line['reason'])}" if "reason" in line else ""
    return Text.assemble((line["state"], "bold"), reason)


WORDS: Mapping[str, Callable[[Line], Text | None]] = {
    "skill": _skill,
    "result": _result,
    "state": _state,
    "feedback": lambda line: Text(shortened(line["text"]), "dim"),
    "picture": lambda line: Text(shortened(line.get("text") or f"picture: {line.get('file')}"), "dim"),
    "error": lambda line: Text(f"{visible(line['kind'])}: {shortened(line['message'])}", "red"),
    "sleep": lambda line: Text(f"waits for {line['seconds']:g} s"),
    "stop": lambda line: Text(f"told to stop by {visible(line['by'])}", "yellow"),
    "cancelled": lambda _: Text("stopped in the middle of it", "yellow"),
    "late": lambda _: Text("ended although it was stopped; nothing more is started", "yellow"),
    "log": lambda line: Text(shortened(line["text"]), "yellow"),
}
"""How each kind of event is told."""


def ending(summary: Summary) -> Group:
    """How a mission ended, and how to see it again, in a line that is not broken, to be pasted."""
    state = State(summary.state)
    text = Text.assemble((state, STYLES.get(state, "bold")), _why(summary))
    if state is State.STOPPED:
        text.append("\nthe robot has stopped")
    again = f"`{mission_command('missions', summary.id)}` shows it again"
    return Group(text, Text(again, "dim", no_wrap=True, overflow="ignore"))


def _why(summary: Summary) -> str:
    line = "" if summary.line is None else f" in line {summary.line}"
    return f"{line}: {shortened(summary.reason)}" if summary.reason else line


def list_view(summaries: Sequence[Summary]) -> RenderableType:
    """All missions, a line each."""
    if not summaries:
        return Text("there are no missions yet", "dim")
    table = grid("left", "left", "left", "left")
    for summary in summaries:
        state = State(summary.state)
        what = summary.instruction or "a program"
        table.add_row(
            summary.id,
            Text(state, STYLES.get(state, "bold")),
            summary.robot,
            Text(shortened(what, 100) + (f"  ({shortened(summary.reason, 200)})" if summary.reason else "")),
        )
    return table


def mission_view(summary: Summary, events: Sequence[Line]) -> RenderableType:
    """One mission: what it was about, and what happened when."""
    head = Text.assemble((f"mission {summary.id}", "bold"), f" on the robot {summary.robot}")
    if summary.instruction:
        head.append(f"\n{shortened(summary.instruction)}")
    if summary.model:
        head.append(f"\nwritten by {shortened(summary.model)}", "dim")
    table = grid("left", "right", "left")
    before: Text | None = None
    for line in events:
        text = told(line)
        if text is not None and text != before:  # another program, while one is drafted, is no other state
            before = text if line["event"] == "state" else None
            at = datetime.fromtimestamp(line["time"]).astimezone()
            table.add_row(Text(f"{at:%H:%M:%S}", "dim"), Text(_at(line), "dim"), text)
    state = State(summary.state)
    problems = [Text(f"problem: {shortened(problem)}", "red") for problem in summary.problems]
    program = Group(Text(), source_view(summary.program))
    end = Text.assemble((state, STYLES.get(state, "bold")), _why(summary))
    return Group(head, program, *problems, table, Text(), end)


def source_view(program: str) -> Group:
    """A program as it stands, without breaks in its lines, and an empty line."""
    lines = [f"    {visible(text.expandtabs(4))}\n" for text in program.splitlines()]
    return Group(Text("".join(lines), no_wrap=True, overflow="ignore"))


def robots_view(kinds: Sequence[Readiness]) -> Table:
    """Which robots work here, and what is missing for the others."""
    table = grid("left", "left", "left")
    for kind in kinds:
        works = Text("works", "green") if kind.works else Text("missing", "red")
        parts = [kind.missing, kind.mend and f"mend it with: {kind.mend}", kind.note]
        table.add_row(Text(kind.name, "bold"), works, Text("\n".join(filter(None, parts))))
    return table
