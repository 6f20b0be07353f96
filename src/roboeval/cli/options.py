"""Defines the options that commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import typer

from roboeval.cli.output import fail


def path_to(what: str) -> Callable[[str], Path]:
    """Return a parser for paths. For an empty string, its error message asks for `what`, such as `a run`."""

    def path(text: str) -> Path:
        return Path(text) if text else fail(f"the argument is empty; name {what}")

    return path


SourceArgument = Annotated[
    str, typer.Argument(help="A run, a .jsonl file, a folder or zip of .py files, or recorded:NAME.")
]
RunArgument = Annotated[Path, typer.Argument(help="A run folder.", parser=path_to("a run"))]
SuiteOption = Annotated[
    str, typer.Option(help="The name of a built-in or installed suite, or a suite folder.")
]
TasksOption = Annotated[str | None, typer.Option(help="Only these tasks, separated by commas.")]
AblationOption = Annotated[bool, typer.Option("--ablation", help="Judge only the common-sense requirements.")]
HouseRulesOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="A file of house rules; a program that breaks a rule is stopped and fails.",
        parser=path_to("a file of rules"),
    ),
]
EngineOption = Annotated[
    Literal["local", "ray"],
    typer.Option(help="Where to run programs: local (this machine) or ray (a Ray cluster)."),
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="Number of programs to run in parallel; one per core by default.")
]
IsolationOption = Annotated[
    bool, typer.Option("--require-isolation", help="Refuse to run programs without full isolation.")
]
ProcessOption = Annotated[
    bool, typer.Option("--one-process-per-run", help="Give every run its own process, which is slower.")
]
WorldsOption = Annotated[
    int | None,
    typer.Option(min=1, max=10_000, help="Number of worlds per task, if the suite samples worlds."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
TurnsOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=1_000,
        help="With --mode: the maximum number of replies in a mission.",
        show_default="300 calls; 4 programs",
    ),
]
ConcurrencyOption = Annotated[int, typer.Option(min=1, help="Maximum number of concurrent requests.")]
