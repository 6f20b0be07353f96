"""A small evaluation, and its output on a terminal, for tests of tables and summaries."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console, RenderableType

from codebotler.simulator.settings import SimulationSettings
from roboeval.suites.load import Suite, Task

HOSTILE = "[red]x[/red]\x1b[2J\x07\u202e\ud800\n"
SHOWN = r"[red]x[/red]\x1b[2J\x07\u202e\ud800\n"

TASK = Task(
    name="Visit",
    summary="Visit Alice.",
    abilities=(),
    prompts=("Visit Alice.", "Go to Alice."),
    facts=(),
    checks=(),
    scenarios=(),
    ablation=None,
    accepted=(),
    path=Path("Visit.yaml"),
)
SUITE = Suite("small", 1, "", SimulationSettings(), {"Visit": TASK, "Wait": replace(TASK, name="Wait")}, "0")


def row(
    prompt: int, index: int, failure: tuple[str, str] | None = None, *, task: str = "Visit"
) -> dict[str, Any]:
    why = failure and {"class": failure[0], "kind": failure[1], "world": 0, "check": None}
    return {"task": task, "prompt": prompt, "index": index, "passed": not why, "failure": why, "verdicts": []}


ROWS = [
    row(0, 0),
    row(0, 1, ("PythonError", "NameError")),
    row(1, 0, ("PythonError", "MemoryError")),
    row(1, 1, ("TaskCompletionError", "Location")),
]


def text_of(renderable: RenderableType, width: int = 80, *, colour: bool = False) -> str:
    console = Console(width=width, force_terminal=colour, color_system="standard" if colour else None)
    with console.capture() as captured:
        console.print(renderable)
    return captured.get()
