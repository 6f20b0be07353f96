"""Shows what one question about candidate programs gains, as a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from roboeval.analysis.metrics import percent

COLUMNS = {"one": "one program", "majority": "majority", "question": "one question"}


def clarify_view(data: Mapping[str, Any], title: str, candidates: int) -> RenderableType:
    """Show pass@1 of one program, of the largest cluster and with a question, for each prompt and overall."""
    table = Table(title=f"{title}, {candidates} candidates", title_justify="left")
    table.add_column("task")
    for name in ("prompt", *COLUMNS.values(), "asked", "mattered"):
        table.add_column(name, justify="right")
    for one in data["prompts"]:
        table.add_row(one["task"], str(one["prompt"]), *_cells(one))
    table.add_section()
    table.add_row("all", "", *_cells(data), style="bold")
    lines = [
        "pass@1 of one program, of the largest group with one behaviour, and of what a person chooses",
        "asked: share of the trials in which the programs differed enough for a question",
        "mattered: questions whose answer changed the verdict on the largest group of programs",
    ]
    if data["tokens"] is not None:
        lines.append(f"{data['tokens']:,.0f} tokens for {candidates} candidates, on average")
    return Group(table, *(Text(line, "dim") for line in lines))


def _cells(of: Mapping[str, Any]) -> list[str]:
    mattered = "-" if of["mattered"] is None else f"{percent(of['mattered'])} %"
    return [*(f"{of[name]:.3f}" for name in COLUMNS), f"{percent(of['asked'])} %", mattered]
