"""Options that commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from roboeval.cli.completion_names import (
    engine_names,
    listed_task_names,
    split_names,
    suite_names,
    task_names,
)
from roboeval.cli.output import fail


def path_to(what: str) -> Callable[[str], Path]:
    """Return a parser of paths that refuses an empty string, which would be the current folder."""

    def path(text: str) -> Path:
        return Path(text) if text else fail(f"the argument is empty; name {what}")

    return path


SourceArgument = Annotated[
    str, typer.Argument(help="A run, a .jsonl, a folder or zip of .py completions, or recorded:NAME.")
]
KeepOption = Annotated[
    Path | None,
    typer.Option(help="Keep completions and verdicts in this run folder.", parser=path_to("a run")),
]
RedoOption = Annotated[
    bool, typer.Option("--redo", help="Discard earlier verdicts and judge everything again.")
]
TaskOption = Annotated[
    str | None, typer.Option(help="Only completions of this task.", autocompletion=task_names)
]
InWorldOption = Annotated[
    str | None, typer.Option(help="Only in this world: its number, from 1, or its description.")
]
RunArgument = Annotated[Path, typer.Argument(help="A run folder.", parser=path_to("a run"))]
SuiteOption = Annotated[
    str,
    typer.Option(
        help="The name of a built-in or installed suite, or a folder.",
        autocompletion=suite_names,
    ),
]
TasksOption = Annotated[
    str | None,
    typer.Option(help="Only these tasks, separated by commas.", autocompletion=listed_task_names),
]
AblationOption = Annotated[bool, typer.Option("--ablation", help="Judge only the common-sense requirements.")]
HouseRulesOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="A file of house rules; a program that breaks one is stopped and fails.",
        parser=path_to("a file of rules"),
    ),
]
EngineOption = Annotated[
    str,
    typer.Option(
        help="Where to run programs: local (this machine) or ray (a Ray cluster).",
        autocompletion=engine_names,
    ),
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="How many programs to run at the same time; all cores by default.")
]
IsolationOption = Annotated[
    bool, typer.Option("--require-isolation", help="Refuse to run programs without full isolation.")
]
ProcessOption = Annotated[
    bool,
    typer.Option("--one-process-per-run", help="Give every run its own process, which takes longer."),
]
WorldsOption = Annotated[
    int | None,
    typer.Option(min=1, max=10_000, help="Draw this many worlds a task, if the suite draws worlds."),
]
WorldSeedOption = Annotated[
    int | None, typer.Option(min=0, help="Draw the worlds from this seed instead of the suite's own.")
]
RequestsOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Ask no model, but write the requests to this file, for a batch endpoint.",
        parser=path_to("a file"),
    ),
]
FamiliesOption = Annotated[
    str | None,
    typer.Option(
        metavar="SPLIT",
        help="Fresh tasks of families, from train, validation or test; --seed chooses them.",
        autocompletion=split_names,
    ),
]
NumTasksOption = Annotated[
    int | None,
    typer.Option(min=1, max=100, help="With --families: how many tasks; by default one of each family."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
OutOption = Annotated[
    Path | None, typer.Option(help="The run folder; by default runs/MODEL.", parser=path_to("a run"))
]
NumOption = Annotated[int, typer.Option(min=1, max=10_000, help="Completions for each prompt.")]
ConcurrencyOption = Annotated[int, typer.Option(min=1, help="Requests under way at the same time.")]
RateOption = Annotated[
    float | None, typer.Option(min=0.001, help="Send at most this many requests a minute.")
]
BudgetOption = Annotated[
    int | None, typer.Option(min=1, help="Stop when this command has used this many tokens.")
]
