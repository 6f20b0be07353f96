"""Defines the options that commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import typer

from roboeval.cli.output import fail


def path_to(what: str) -> Callable[[str], Path]:
    """Return a path parser that rejects an empty string, which would mean the current folder."""

    def path(text: str) -> Path:
        return Path(text) if text else fail(f"the argument is empty; name {what}")

    return path


SourceArgument = Annotated[
    str, typer.Argument(help="A run, a .jsonl file, a folder or zip of .py files, or recorded:NAME.")
]
KeepOption = Annotated[
    Path | None,
    typer.Option(help="Save completions and verdicts in this run folder.", parser=path_to("a run")),
]
RedoOption = Annotated[
    bool, typer.Option("--redo", help="Discard earlier verdicts and judge everything again.")
]
TaskOption = Annotated[str | None, typer.Option(help="Only completions for this task.")]
InWorldOption = Annotated[
    str | None, typer.Option(help="Only in the world with this number, from 1, or description.")
]
RunArgument = Annotated[Path, typer.Argument(help="A run folder.", parser=path_to("a run"))]
SuiteOption = Annotated[
    str,
    typer.Option(help="The name of a built-in or installed suite, or a suite folder."),
]
TasksOption = Annotated[
    str | None,
    typer.Option(help="Only these tasks, separated by commas."),
]
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
    bool,
    typer.Option("--one-process-per-run", help="Give every run its own process, which is slower."),
]
WorldsOption = Annotated[
    int | None,
    typer.Option(min=1, max=10_000, help="Number of worlds per task, if the suite samples worlds."),
]
WorldSeedOption = Annotated[
    int | None, typer.Option(min=0, help="Random seed for sampling worlds, instead of the suite's own seed.")
]
RequestsOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Write the requests to this file for a batch endpoint; query no model.",
        parser=path_to("a file"),
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
OutOption = Annotated[
    Path | None, typer.Option(help="The run folder; by default runs/MODEL.", parser=path_to("a run"))
]
NumOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=10_000,
        help="Number of completions per prompt; with --mode, of missions per prompt and world.",
        show_default="50; with --mode agent or replan 1",
    ),
]
ModeOption = Annotated[
    Literal["program", "agent", "replan"],
    typer.Option(
        help="How the model is used: it writes a program for all worlds of a task, calls skills as an agent "
        "in each world, or writes a program in each world and, after each failure, one for the rest."
    ),
]
TurnsOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=1_000,
        help="With --mode: the maximum number of replies in a mission.",
        show_default="300 calls; 4 programs",
    ),
]
MissionTokensOption = Annotated[
    int | None, typer.Option(min=1, help="With --mode: the maximum number of tokens of a mission.")
]
ConcurrencyOption = Annotated[int, typer.Option(min=1, help="Maximum number of concurrent requests.")]
RateOption = Annotated[float | None, typer.Option(min=0.001, help="Maximum number of requests per minute.")]
BudgetOption = Annotated[int | None, typer.Option(min=1, help="Stop after using this many tokens.")]
PublishedOption = Annotated[
    bool, typer.Option("--published", help="Add the failure causes that the paper published.")
]
PricesOption = Annotated[
    list[str] | None,
    typer.Option(help="MODEL=INPUT/OUTPUT, the prices per million tokens; may be given several times."),
]
LabelsOption = Annotated[
    list[str] | None,
    typer.Option(help="RUN=TEXT, the name of a run in tables and figures; may be given several times."),
]
BesideOption = Annotated[
    str | None, typer.Option(help="Compare with the verdicts of another suite that judged the runs.")
]
CheckOption = Annotated[
    bool, typer.Option(help="Run the check on programs not checked yet, for rejection sampling.")
]
