"""What a robot did, drawn step by step and room by room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

from rich.console import RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from roboeval.tables import grid, shortened, visible

DID = {"say": "said", "pick": "picked up", "place": "put down"}

MOST_STEPS, FIRST_STEPS, LAST_STEPS, LONGEST_PERIOD = 40, 12, 6, 20
MOST_OPTIONS = 20


def storyboard(steps: Sequence[Mapping[str, Any]], needed: set[int | None]) -> Table:
    """The steps room by room; a long trace keeps its ends and the steps that explanations name."""
    table = grid("right", "left")
    if not steps:
        table.add_row(Text(), Text("the robot did nothing", "dim"))
        return table
    if steps[0]["kind"] != "goto" and "place" in steps[0]:
        table.add_row(Text(), Text(f"in {visible(steps[0]['place'])}", "bold"))
    last = len(steps) - LAST_STEPS

    def is_shown(step: Mapping[str, Any]) -> bool:
        number = step["step"]
        return len(steps) <= MOST_STEPS or number <= FIRST_STEPS or number > last or number in needed

    for shown, some in groupby(steps, key=is_shown):
        if shown:
            for step in some:
                table.add_row(Text(str(step["step"]), "dim"), _step(step))
        else:
            hidden = list(some)
            table.add_row(Text(), Text(f"... {len(hidden):,} more{_repeating(steps, hidden)} ...", "dim"))
    return table


def _repeating(steps: Sequence[Mapping[str, Any]], hidden: Sequence[Mapping[str, Any]]) -> str:
    def same(a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
        return {**a, "step": 0} == {**b, "step": 0}

    first = hidden[0]["step"] - 1
    for period in range(1, min(LONGEST_PERIOD, first) + 1):
        if all(same(steps[at], steps[at - period]) for at in range(first, first + len(hidden))):
            repeated = f"step {first}" if period == 1 else f"steps {first - period + 1} to {first}"
            return f", repeating {repeated}"
    return ""


def _step(step: Mapping[str, Any]) -> RenderableType:
    text = f'"{shortened(step["text"])}"'
    if step["kind"] == "goto":
        return _drive(step, text)
    match step["kind"]:
        case "check":
            told = f"looked for {text}: {'found' if step.get('found') else 'not found'}"
        case "ask":
            answer = "no answer" if step["answer"] is None else shortened(step["answer"])
            told = f"asked {text} {_options(step['options'])} → {answer}"
        case kind:
            told = f"{DID.get(kind) or visible(kind)} {text}"
    return Padding(Text(told), (0, 0, 0, 4))


def _drive(step: Mapping[str, Any], request: str) -> Text:
    if "place" not in step:
        return Text(f"→ {request}", "bold")
    start = f"{visible(step['place'])} → "
    if step["to"] is None:
        return Text.assemble((f"{start}{request}", "bold"), ("  failed: there is no such room", "red"))
    drive = Text(start + visible(step["to"]), "bold")
    return drive if step["to"] == step["text"] else drive.append(f"  (asked for {request})", "not bold")


def _options(options: Sequence[str | Mapping[str, str]]) -> str:
    shown = [shortened(o) if isinstance(o, str) else f"{shortened(o['no text'])} (no text)" for o in options]
    left = len(shown) - MOST_OPTIONS
    return f"[{' | '.join(shown[:MOST_OPTIONS] + [f'{left:,} more'] * (left > 0))}]"
