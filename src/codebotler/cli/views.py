"""Show missions, models and robots in a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Self

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from codebotler.checking.storyboard import grid
from codebotler.core.terminal import console, shortened, visible
from codebotler.missions.display.view import SessionView
from codebotler.missions.display.wording import event_text, timeline, title
from codebotler.missions.storage.log import LogLine, MissionState, MissionSummary
from codebotler.missions.storage.store import last_rest, rest_text, rests_in
from codebotler.models.open import ChosenModel
from codebotler.models.recorded import is_recorded
from codebotler.models.usable import MODEL_HINT, UsableModel
from codebotler.robots.base import Readiness

STATE_STYLES: Mapping[MissionState, str] = {
    MissionState.DONE: "bold green",
    MissionState.FAILED: "bold red",
    MissionState.STOPPED: "bold yellow",
    MissionState.INTERRUPTED: "bold red",
}
EVENT_STYLES: Mapping[str, str] = {
    "error": "red",
    **dict.fromkeys(("feedback", "picture"), "dim"),
    **dict.fromkeys(("rule", "stop", "cancelled", "late", "log"), "yellow"),
}
MAX_PLAIN_SECONDS = 999_999.95  # longer times are shown with an exponent, to fit into ten characters
CLEAR_LINE = "\r\x1b[2K"


class EventPrinter:
    """Prints a mission's events as they happen. On a terminal, feedback disappears at the next event."""

    def __init__(self, robot: str) -> None:
        self._console = console(highlight=False)
        self._is_half = False
        self._console.print()
        self._console.print(Text.assemble(("running", "bold"), f" on the robot {robot}"))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end_line()

    def __call__(self, line: LogLine) -> None:
        """Print an event."""
        text = Text(event_text(line), EVENT_STYLES.get(line["event"], ""))
        if not text or line["event"] == "state":
            return
        if line["event"] == "skill" and line["skill"] == "go_to":
            text.stylize("bold")
        passing = line["event"] == "feedback" and self._console.is_terminal
        self._end_line()
        time = Text(f"{_time_text(line):>10}  " if line["event"] in {"skill", "sleep"} else " " * 12, "dim")
        self._console.print(time + text, end="" if passing else "\n", soft_wrap=True)
        self._console.file.flush()
        self._is_half = passing

    def _end_line(self) -> None:
        if self._is_half:
            self._console.file.write(CLEAR_LINE)
            self._is_half = False


def _time_text(line: LogLine) -> str:
    """Return the time of an event on the robot's clock, such as `12.5 s`."""
    clock = float(line["clock"])
    return f"{clock:.1f} s" if clock < MAX_PLAIN_SECONDS else f"{clock:.1e} s"


def ending_view(ended: SessionView) -> Group:
    """Return how a mission ended and, on a line that is never wrapped, the command that shows it again."""
    state = ended.state
    assert state is not None, "the mission has begun"
    text = Text.assemble((state, STATE_STYLES.get(state, "bold")), _why(ended))
    if state is MissionState.STOPPED:
        text.append("\nthe robot has stopped")
    again = f"`codebotler missions {ended.id}` shows this mission again"
    return Group(text, Text(again, "dim", no_wrap=True, overflow="ignore"))


def continue_view(ended: SessionView) -> Text:
    """Return a line that tells how to continue a mission. The line is never wrapped, so it can be copied."""
    options = "add --world, --robot, --model and --base-url as you gave them now"
    command = f"`codebotler continue {ended.id}` does the rest; {options}"
    return Text(command, "dim", no_wrap=True, overflow="ignore")


def _why(ended: MissionSummary | SessionView) -> str:
    line = "" if ended.line is None else f" in line {ended.line}"
    if ended.state is not None and ended.reason.startswith(f"{ended.state} "):  # such as `stopped by Ctrl-C`
        return shortened(ended.reason).removeprefix(ended.state) + line
    return f"{line}: {shortened(ended.reason)}" if ended.reason else line


def list_view(summaries: Sequence[MissionSummary]) -> RenderableType:
    """Return a table of missions with one line each, or a sentence if there are none."""
    if not summaries:
        return Text("there are no missions yet", "dim")
    table = grid("left", "left", "left", "left")
    rests = rests_in(summaries)
    for summary in summaries:
        state = summary.state
        table.add_row(
            summary.id,
            Text(state, STATE_STYLES.get(state, "bold")),
            summary.robot,
            Text(
                shortened(title(summary), 100)
                + (f"  ({shortened(summary.reason, 200)})" if summary.reason else "")
                + (f"  continues {summary.continues}" if summary.continues else "")
                + (f"  {rest}" if (rest := rest_text(last_rest(summary.id, rests))) else "")
            ),
        )
    return table


def mission_view(
    summary: MissionSummary, events: Sequence[LogLine], rest: MissionSummary | None = None
) -> RenderableType:
    """Return a view of a mission: its program, events and end, and the end of its continuation `rest`."""
    head = Text.assemble((f"mission {summary.id}", "bold"), f" on the robot {summary.robot}")
    if summary.instruction:
        head.append(f"\n{shortened(summary.instruction)}")
    if summary.program:
        author = f"written by {shortened(summary.model)}" if summary.model else "typed or changed by hand"
        head.append(f"\n{author}", "dim")
    table = grid("left", "right", "left")
    for line, words in timeline(events):
        at = datetime.fromtimestamp(line["time"]).astimezone()
        text = Text(words, EVENT_STYLES.get(line["event"], ""))
        table.add_row(Text(f"{at:%H:%M:%S}", "dim"), Text(_time_text(line), "dim"), text)
    state = summary.state
    problems = [Text(f"problem: {shortened(problem)}", "red") for problem in summary.problems]
    program = Group(Text(), source_view(summary.program))
    end = Text.assemble((state, STATE_STYLES.get(state, "bold")), _why(summary))
    if rest is not None:
        end.append(f"\n{rest_text(rest)}", "dim")
    return Group(head, program, *problems, table, Text(), end)


def source_view(program: str) -> Group:
    """Return a program for printing: its lines are never wrapped, and an empty line follows."""
    lines = [f"    {visible(text.expandtabs(4))}\n" for text in program.splitlines()]
    return Group(Text("".join(lines), no_wrap=True, overflow="ignore"))


def models_view(models: Sequence[UsableModel], chosen: ChosenModel) -> Group:
    """Return a table of the usable models with the options that select them, and the default model."""
    table = grid("left", "left")
    for model in models:
        table.add_row(Text(model.options, "bold"), Text(model.why, "dim"))
    lines = [f"default model: {visible(chosen.name)}"]
    if all(is_recorded(model.name) for model in models):
        lines.append(f"for other instructions, {MODEL_HINT}")
    return Group(table, Text(), *map(Text, lines))


def robots_view(kinds: Sequence[Readiness]) -> Table:
    """Return a table of robots: which kinds work on this machine, and what is missing for the others."""
    table = grid("left", "left", "left")
    for kind in kinds:
        works = Text("works", "green") if kind.works else Text("unavailable", "red")
        parts = [kind.missing, kind.mend and f"to fix: {kind.mend}", kind.note]
        table.add_row(Text(kind.name, "bold"), works, Text("\n".join(filter(None, parts))))
    return table
