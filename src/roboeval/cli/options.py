"""What the commands of RoboEval share: their options, and how they find what a user names."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roboeval.cli.completion import engine_names, listed_task_names, suite_names
from roboeval.cli.output import fail, note

if TYPE_CHECKING:
    from roboeval.evaluation.engines import OpenEngine
    from roboeval.evaluation.evaluation import Evaluation
    from roboeval.suites.load import Suite


def named(what: str) -> Callable[[str], Path]:
    """A reader of paths that refuses the empty one, which would be the current folder."""

    def path(text: str) -> Path:
        return Path(text) if text else fail(f"nothing is named; name {what}")

    return path


RunArgument = Annotated[Path, typer.Argument(help="A run.", parser=named("a run"))]
SuiteOption = Annotated[
    str,
    typer.Option(
        help="A suite that ships with RoboEval or is installed, by its name; or a folder.",
        autocompletion=suite_names,
    ),
]
TasksOption = Annotated[
    str | None,
    typer.Option(help="Only these tasks, separated by commas.", autocompletion=listed_task_names),
]
AblationOption = Annotated[bool, typer.Option("--ablation", help="Require common sense only.")]
EngineOption = Annotated[
    str,
    typer.Option(
        help="Where programs are run: local, on this machine, or ray, on a Ray cluster.",
        autocompletion=engine_names,
    ),
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="Programs that run at the same time; all cores by default.")
]
IsolationOption = Annotated[
    bool, typer.Option("--require-isolation", help="Refuse where programs are not fully isolated.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]


def load(suite: str) -> Suite:
    """Read a suite by name or folder."""
    from roboeval.suites.load import load_suite

    return load_suite(suite)


def as_judged(run: Path, suite: Suite, *, ablated: bool) -> Suite:
    """The suite with the worlds in which a run was judged, if they were drawn otherwise than now."""
    from roboeval.evaluation.run import Run, evaluation_key, load_head

    path = Run(run).head(evaluation_key(suite, ablated=ablated))
    if suite.worlds is None or not path.is_file():
        return suite
    match load_head(path):
        case {"worlds": int(worlds), "seed": int(seed)} if worlds > 0:
            return suite.with_worlds(worlds, seed)
    return suite


def command(verb: str, *arguments: object, suite: str, ablated: bool = False) -> str:
    """A command for the user to paste."""
    from codebotler.pasted import runnable

    return shlex.join([runnable("roboeval"), *_words(verb, *arguments, suite=suite, ablated=ablated)])


def command_anywhere(verb: str, *arguments: object, suite: str) -> str:
    """A command for whoever reads it, wherever that is."""
    return shlex.join(["roboeval", *_words(verb, *arguments, suite=suite)])


def _words(verb: str, *arguments: object, suite: str, ablated: bool = False) -> list[str]:
    words = [verb, *map(str, arguments)]
    words += [] if suite == "paper" else ["--suite", suite]
    return [*words, "--ablation"] if ablated else words


def options_of(evaluation: Evaluation, suite: Suite) -> list[str]:
    """What else a command needs to go on with an evaluation."""
    from roboeval.evaluation.run import tasks_to_judge

    tasks = evaluation.scope.tasks
    drawn = [("--worlds", suite.worlds), ("--seed", suite.seed)] if suite.folder else []
    own = suite.with_own_worlds() if suite.worlds is not None else suite
    worlds = [text for name, number in drawn if own.digest != suite.digest for text in (name, str(number))]
    if tasks in {None, tasks_to_judge(suite, None, ablated=bool(evaluation.head.get("ablation")))[0]}:
        return worlds
    return ["--tasks", ",".join(sorted(tasks or ())), *worlds]


def open_evaluation(run: Path, suite: Suite, suite_name: str, *, ablated: bool) -> Evaluation:
    """An evaluation that a user names."""
    from codebotler.badinput import BadInput
    from roboeval.evaluation.evaluation import Evaluation
    from roboeval.evaluation.run import Run, evaluation_key

    folder, key = Run(run), evaluation_key(suite, ablated=ablated)
    if not folder.completions.is_file():
        raise BadInput("is no run: it holds no completions.jsonl", file=run)
    if not folder.rows(key).is_file():
        others = folder.judged_by()
        if others and suite.name not in others:
            judges, ours = " and ".join(f'"{name}"' for name in others), f'"{suite.name}"'
            raise BadInput(f"was judged by the suite {judges}, not by {ours}; name it with --suite", file=run)
        again = command("evaluate", run, suite=suite_name, ablated=ablated)
        raise BadInput(f"has not been judged; `{again}` does it", file=run)
    evaluation = Evaluation(folder, key)
    if not folder.programs(key).is_file():
        again = command("evaluate", run, *options_of(evaluation, suite), suite=suite_name, ablated=ablated)
        raise BadInput(
            f"is missing, so that nobody knows which programs were judged; `{again}` judges them again",
            file=folder.programs(key),
        )
    if evaluation.head.get("digest") != suite.digest:
        note("the suite has changed since this run was judged; explanations may be missing")
    return evaluation


def expect_current(evaluation: Evaluation, suite: Suite, suite_name: str) -> None:
    """Refuse verdicts on programs that have changed since; to be called when all rows were read.

    Raises:
        BadInput: a row judges another program than stands in the run now, or there is no row.
    """
    from codebotler.badinput import BadInput

    ablated = bool(evaluation.head.get("ablation"))
    path = evaluation.run.path
    again = command("evaluate", path, *options_of(evaluation, suite), suite=suite_name, ablated=ablated)
    if (complaint := evaluation.complaint()) is not None:
        raise BadInput(f"{complaint}; `{again} --redo` judges what stands there")
    if evaluation.count == 0:
        raise BadInput(f"no completion has been judged; `{again}` goes on", file=path)
    if (unfinished := evaluation.unfinished()) is not None:
        note(f"{unfinished}, and only these count; `{again}` goes on")


def cores() -> int:
    """How many programs to run at the same time."""
    return os.cpu_count() or 1


def engine_named(name: str, workers: int | None, *, require_isolation: bool = False) -> OpenEngine:
    """The engine that a user names."""
    from roboeval.evaluation.engines import Local

    if name == "local":
        return Local(workers or cores(), require_isolation=require_isolation)
    if name != "ray":
        fail(f'there is no engine "{name}"; there are local and ray')
    from roboeval.evaluation.ray import Cluster

    return Cluster(workers, require_isolation=require_isolation)
