"""Why programs pass or fail: a reason for each program of a prompt, and every step of one in each world."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.syntax import Syntax
from rich.text import Text

from codebotler.english import counted
from codebotler.rtl import explain
from codebotler.simulator.robot import located, resolve_room
from codebotler.storyboard import grid, steps_of, storyboard
from codebotler.terminal import shortened, visible
from codebotler.trace import Event, Trace
from codebotler.tracefile import trace_from
from codebotler.world import World
from roboeval.evaluation.completions import Completion, name_of
from roboeval.evaluation.tables import (
    NOT_RECORDED,
    RowData,
    Selection,
    by_hand,
    key_of,
    kind_of,
    of_task,
    parse_selection,
    prompt_head,
    prompt_lines,
    task_data,
    task_view,
)
from roboeval.suites.load import Scenario, Suite

__all__ = [
    "Selection",
    "completion_data",
    "completion_view",
    "parse_selection",
    "prompt_data",
    "prompt_view",
    "task_data",
    "task_view",
    "view",
    "view_data",
]

GONE = "the program that was judged no longer stands in this run"
CHANGED = "the suite has changed since this was judged"
CUT = "the trace that was judged is too long to be kept, so this cannot be explained"
TOO_LONG = "the traces of this program are too long for this to be explained as well"

MOST_LINES, EXPLANATION = 1_000, 2_000
MOST_COMPARED = 1_000_000  # of the traces of a completion, to explain it, by these weights:
EVENT, SPOKEN, OTHER = 20, 10, 1  # an event, a character that is said, asked or offered, and any other one


# --- what there is to show, as plain data


def prompt_data(
    rows: Iterable[RowData],
    completions: Iterable[Completion],
    suite: Suite,
    task: str,
    prompt: int,
    *,
    ablated: bool = False,
) -> dict[str, Any]:
    """A prompt, program by program, with the one reason why each fails; equal programs are told once.

    Args:
        rows: of the evaluation.
        completions: that were judged; the program of a row whose completion is not there is gone.
        suite: by which they were judged.
        task: its name.
        prompt: counted from 0.
        ablated: whether common sense only was required.

    Raises:
        BadInput: the prompt has no row.
    """
    found = Selection(task, prompt).rows(rows)
    written = of_task(completions, task)
    programs: dict[object, list[RowData]] = defaultdict(list)
    for row in found:
        completion = written.get(key_of(row))
        programs[row["index"] if completion is None else completion.program].append(row)
    return {
        "task": task,
        **prompt_head(prompt, found, written),
        "programs": [
            {
                "indices": [row["index"] for row in same],
                "gone": key_of(same[0]) not in written,
                **reason(same[0], suite, ablated=ablated),
            }
            for same in programs.values()
        ],
    }


class Patience:
    """How much of the traces of one completion is still compared with what was required."""

    def __init__(self) -> None:
        self._left = MOST_COMPARED

    def reaches_for(self, trace: Trace) -> bool:
        """Whether a check on a trace is still explained; if so, that is taken into account."""
        self._left -= sum(map(_weight, trace))
        return self._left >= 0


def _weight(event: Event) -> int:
    each = SPOKEN if event.kind in {"say", "ask"} else OTHER
    return EVENT + each * (len(event.text) + sum(len(option.text) for option in event.options))


def reason(row: RowData, suite: Suite, *, ablated: bool) -> dict[str, Any]:
    """Why a completion fails: the world that decided, and its error or failed check, explained.

    Args:
        row: of the evaluation; of its verdicts only that of the world that decided is looked at closely.
        suite: by which it was judged.
        ablated: whether common sense only was required.
    """
    why = row["failure"]
    if why is None:
        return {"passed": True, "failure": None}
    verdict = row["verdicts"][why["world"]]
    told = {key: verdict[key] for key in ("world", "error", "line")}
    if why["check"] is None:
        return {"passed": False, "failure": why, **told, "explanation": None, "step": None}
    scenario = _scenario(suite, row, why["world"], ablated=ablated)
    explained = _explained(why["check"], scenario, _trace(verdict, scenario), Patience(), verdict.get("cut"))
    return {"passed": False, "failure": why, **told, **explained}


def completion_data(
    row: RowData, completion: Completion | None, suite: Suite, *, ablated: bool = False
) -> dict[str, Any]:
    """One completion: what was asked, the program, and each world with every step and failed check.

    Args:
        row: of the evaluation.
        completion: that was judged; None if it is not there.
        suite: by which it was judged.
        ablated: whether common sense only was required.
    """
    patience = Patience()
    return {
        **{key: row[key] for key in ("task", "prompt", "index", "passed", "failure")},
        **{key: getattr(completion, key, None) for key in ("model", "instruction", "program")},
        "worlds": [
            _world_data(verdict, _scenario(suite, row, number, ablated=ablated), patience)
            for number, verdict in enumerate(row["verdicts"])
        ],
    }


def _scenario(suite: Suite, row: RowData, number: int, *, ablated: bool) -> Scenario | None:
    """The scenario in which a verdict was reached; None if the suite has it no more."""
    task = suite.tasks.get(row["task"])
    scenarios = () if task is None else task.judged_in(ablated=ablated)
    about = row["verdicts"][number]["world"]
    return next((s for s in (*scenarios[number : number + 1], *scenarios) if s.world.about == about), None)


def _trace(verdict: RowData, scenario: Scenario | None) -> Trace:
    trace = trace_from(verdict["trace"], further=True)
    return trace if scenario is None else located(trace, scenario.world)


def _world_data(verdict: RowData, scenario: Scenario | None, patience: Patience) -> dict[str, Any]:
    trace, cut = _trace(verdict, scenario), verdict.get("cut")
    return {
        **{key: verdict[key] for key in ("world", "satisfied", "status", "error", "line")},
        "steps": steps_of(trace, None if scenario is None else _rooms_of(scenario.world)),
        **({} if cut is None else {"cut": cut}),
        "failed_checks": [
            {"check": check, **_explained(check, scenario, trace, patience, cut)}
            for check in verdict["failed_checks"]
        ],
    }


def _rooms_of(world: World) -> Callable[[str], str | None]:
    rooms = [room.name for room in world.rooms]
    return lambda request: resolve_room(rooms, request)


def _explained(
    check: str, scenario: Scenario | None, trace: Trace, patience: Patience, cut: object
) -> dict[str, Any]:
    """Why a check fails, with the step that makes it fail if it is one."""
    if cut is not None:
        return {"explanation": CUT, "step": None}
    require = () if scenario is None else scenario.require
    requirement = next((r for r in require if r.text == check), None)
    if requirement is None:
        return {"explanation": f"{CHANGED} and no longer requires this here", "step": None}
    if not patience.reaches_for(trace):
        return {"explanation": TOO_LONG, "step": None}
    why = explain(requirement.formula, trace)
    if why is None:
        return {"explanation": f"{CHANGED}; by now this is satisfied", "step": None}
    return {"explanation": why.sentence, "step": None if why.event is None else why.event + 1}


def view_data(
    part: Selection,
    rows: Iterable[RowData],
    completions: Iterable[Completion],
    suite: Suite,
    *,
    ablated: bool = False,
) -> dict[str, Any]:
    """A task, a prompt or a completion as plain data.

    Raises:
        BadInput: it has no row.
    """
    if part.index is not None:
        return completion_data(*_one(part, rows, completions), suite, ablated=ablated)
    assert part.task is not None
    if part.prompt is not None:
        return prompt_data(rows, completions, suite, part.task, part.prompt, ablated=ablated)
    return task_data(rows, completions, suite, part.task)


def _one(
    part: Selection, rows: Iterable[RowData], completions: Iterable[Completion]
) -> tuple[RowData, Completion | None]:
    row = part.rows(rows)[0]
    return row, next((completion for completion in completions if completion.key == key_of(row)), None)


# --- what people see of it


def view(
    part: Selection,
    rows: Iterable[RowData],
    completions: Iterable[Completion],
    suite: Suite,
    *,
    ablated: bool = False,
) -> RenderableType:
    """What `view_data` says, for a person."""
    if part.index is not None:
        return completion_view(*_one(part, rows, completions), suite, ablated=ablated)
    assert part.task is not None
    if part.prompt is not None:
        return prompt_view(rows, completions, suite, part.task, part.prompt, ablated=ablated)
    return task_view(rows, completions, suite, part.task)


def prompt_view(
    rows: Iterable[RowData],
    completions: Iterable[Completion],
    suite: Suite,
    task: str,
    prompt: int,
    *,
    ablated: bool = False,
) -> RenderableType:
    """What `prompt_data` says, for a person."""
    data = prompt_data(rows, completions, suite, task, prompt, ablated=ablated)
    table = grid("right", "left")
    for program in data["programs"]:
        table.add_row(f"  {program['indices'][0]}", _told(program))
    lines = prompt_lines(task, data)
    lines[0].append(by_hand(data["models"]))
    return Group(*lines, Text(), table)


def _told(program: Mapping[str, Any]) -> Text:
    same = len(program["indices"])
    often = Text(f"x{same:,}  " if same > 1 else "")
    if program["gone"]:
        often.append(f"{GONE}\n", "yellow")
    if program["passed"]:
        return often.append("passed", "green")
    text = Text.assemble(often, kind_of(program["failure"]), f' in "{visible(program["world"])}"')
    if program["explanation"] is None:
        why = _error_sentence(program)
    else:
        why = f"{visible(program['failure']['check'])}: {shortened(program['explanation'], EXPLANATION)}"
    return text.append(f"\n{why}" if why else "")


def _error_sentence(verdict: Mapping[str, Any]) -> str:
    """Where an error arose and what it says, of which either may be unknown."""
    where = "" if verdict["line"] is None else f"line {verdict['line']}"
    return ": ".join(filter(None, [where, shortened(verdict["error"]["message"])]))


def completion_view(
    row: RowData, completion: Completion | None, suite: Suite, *, ablated: bool = False
) -> RenderableType:
    """What `completion_data` says, for a person."""
    data = completion_data(row, completion, suite, ablated=ablated)
    lines = {world["line"] for world in data["worlds"] if not world["satisfied"]}
    parts: list[RenderableType] = [_completion_head(data)]
    if data["program"] is not None:
        parts += [Text(), *_program(data["program"], lines)]
    for number, world in enumerate(data["worlds"], 1):
        parts += [Text(), *_world(world, f"World {number} of {len(data['worlds'])}: ")]
    return Group(*parts)


def _completion_head(data: Mapping[str, Any]) -> Text:
    head = Text.assemble((visible(name_of((data["task"], data["prompt"], data["index"]))), "bold"), "  ")
    why = data["failure"]
    head.append_text(Text("passed", "green") if why is None else kind_of(why))
    if data["model"] is not None:
        head.append(f"\nwritten by {visible(data['model'])}{by_hand([data['model']])}", "dim")
    if data["program"] is None:
        return head.append(f"\n{GONE}", "yellow")
    told = NOT_RECORDED if data["instruction"] is None else visible(data["instruction"])
    return head.append(f"\n{told}", "italic")


def _program(program: str, marked: set[int | None]) -> list[RenderableType]:
    lines = program.replace("\r\n", "\n").replace("\r", "\n").rstrip("\n").split("\n")
    source = "\n".join(shortened(line.expandtabs(4)) for line in lines[:MOST_LINES])
    syntax = Syntax(
        source,
        "python",
        theme="ansi_dark",
        background_color="default",
        line_numbers=True,
        highlight_lines={line for line in marked if line is not None},
        word_wrap=True,
    )
    left = len(lines) - MOST_LINES
    return [syntax, Text(f"... {left:,} more lines", "dim")] if left > 0 else [syntax]


def _world(world: Mapping[str, Any], name: str) -> list[RenderableType]:
    cut = world.get("cut")
    parts: list[RenderableType] = [Text(name + visible(world["world"]), "bold"), _ending(world)]
    if world["steps"] or cut is None:
        parts.append(storyboard(world["steps"], {check["step"] for check in world["failed_checks"]}))
    if cut is not None:
        parts.append(Padding(Text(cut_told(cut), "yellow"), (0, 0, 0, 2)))
    for check in world["failed_checks"]:
        text = Text.assemble(
            ("failed ", "red"), visible(check["check"]), f": {shortened(check['explanation'], EXPLANATION)}"
        )
        parts.append(Padding(text, (0, 0, 0, 2)))
    return parts


def cut_told(cut: Mapping[str, Any]) -> str:
    """How much of a trace was not kept, in a sentence."""
    were = "was" if cut["events"] == 1 else "were"
    return f"{counted(cut['events'], 'more step')} {were} not kept, since the trace is too long"


def _ending(world: Mapping[str, Any]) -> Text:
    text = Text("satisfied", "green") if world["satisfied"] else Text("not satisfied", "red")
    text = Text.assemble(text, f", {world['status']}")
    if world["error"] is None:
        return text
    allowed = " (allowed here)" if world["satisfied"] else ""
    told = ", ".join(filter(None, [visible(world["error"]["kind"]), _error_sentence(world)]))
    return text.append(f"{allowed}: {told}")
