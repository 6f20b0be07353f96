"""The command line of RoboEval; what a command needs is imported when it runs, so that help is quick."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, TypeVar

import typer

if TYPE_CHECKING:
    from rich.console import RenderableType

    from roboeval.records import Completion
    from roboeval.suite import Suite

Item = TypeVar("Item")

app = typer.Typer(
    help="How good are language models at writing programs for service robots?",
    rich_markup_mode=None,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)

SuiteOption = Annotated[str, typer.Option(help="A suite that ships with the package, or a folder.")]
TasksOption = Annotated[str | None, typer.Option(help="Only these tasks, separated by commas.")]
AblationOption = Annotated[bool, typer.Option("--ablation", help="Require common sense only.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]


@app.command()
def evaluate(
    source: Annotated[
        str, typer.Argument(help="A run, a .jsonl, a folder or zip of .py completions, or recorded:NAME.")
    ],
    out: Annotated[Path | None, typer.Option(help="Keep completions and verdicts in this run.")] = None,
    suite: SuiteOption = "paper",
    tasks: TasksOption = None,
    ablation: AblationOption = False,
    redo: Annotated[bool, typer.Option("--redo", help="Start over.")] = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Programs that run at the same time; all cores by default.")
    ] = None,
    worlds: Annotated[int | None, typer.Option(help="Judge in this many generated worlds.")] = None,
    engine: Annotated[str, typer.Option(help="local or ray.")] = "local",
    require_isolation: Annotated[
        bool, typer.Option("--require-isolation", help="Refuse where programs are not fully isolated.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Say of every completion whether it does what was asked."""
    from roboeval.evaluate import evaluate as judge_all
    from roboeval.run import Run, evaluate_run, open_source, tasks_to_judge

    refuse_what_comes_later(suite, worlds, engine)
    judged_by = load(suite)
    wanted, left = tasks_to_judge(judged_by, tasks, ablated=ablation)
    if left:
        note(f"without ablation, and so not judged: {', '.join(left)}")
    opened = open_source(source, judged_by)
    total = sum(1 for _ in opened.checked(judged_by, wanted))
    if total == 0:
        fail(f"{source}: there is no completion of {tasks or 'a task with an ablation'} in it")
    run = opened.run
    if out is not None and (run is None or out.resolve() != run.path.resolve()):
        run = Run(out)
        with run.writing():
            run.keep(opened, judged_by)
    if run is None:
        completions = opened.checked(judged_by, wanted)
        rows: Iterator[dict[str, Any]] = judge_all(
            completions,
            judged_by,
            ablated=ablation,
            workers=workers or cores(),
            require_isolation=require_isolation,
        )
    else:
        rows = evaluate_run(
            run,
            judged_by,
            ablated=ablation,
            tasks=wanted,
            redo=redo,
            workers=workers or cores(),
            require_isolation=require_isolation,
        )
    title = f"{source} (programs written by hand)" if source.startswith("recorded") else source
    print_summary(watched(rows, total), judged_by, title=title, ablated=ablation, as_json=json)
    if run is not None:
        note(f"verdicts are in {run.path}; `roboeval show {run.path} TASK/PROMPT/INDEX` says why one fails")


@app.command()
def show(
    run: Annotated[Path, typer.Argument(help="A run.")],
    what: Annotated[str | None, typer.Argument(help="TASK, TASK/PROMPT or TASK/PROMPT/INDEX.")] = None,
    suite: SuiteOption = "paper",
    ablation: AblationOption = False,
    k: Annotated[list[int] | None, typer.Option("--k", min=1, help="Also pass@k for this k.")] = None,
    json: JsonOption = False,
) -> None:
    """Print a run's tables, or show why a completion fails."""
    from roboeval.show import view, view_data
    from roboeval.tables import parse_selection

    judged_by = load(suite)
    selection = parse_selection(what, judged_by)
    rows, completions = read_evaluation(run, judged_by, ablated=ablation)
    if selection.task is None:
        ks = sorted({1, *(k or [])})
        print_summary(rows, judged_by, title=str(run), ablated=ablation, as_json=json, k=ks)
    elif json:
        print_json(view_data(selection, rows, completions, judged_by, ablated=ablation))
    else:
        print_rich(view(selection, rows, completions, judged_by, ablated=ablation))


@app.command()
def tasks(
    task: Annotated[str | None, typer.Argument(help="Show this task.")] = None,
    suite: SuiteOption = "paper",
    lint: Annotated[bool, typer.Option("--lint", help="Look for faults; status 1 if there are any.")] = False,
    new: Annotated[
        str | None, typer.Option(help="Start a task of this name in the folder of --suite.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """List a suite's tasks, show one, lint them, start a new one."""
    from roboeval.catalogue import new_task, suite_data, suite_view, task_view

    if new is not None:
        if suite == "paper":
            fail("name the folder of your own suite with --suite; the suite of the paper stays as it is")
        note(f"fill in {new_task(Path(suite), new)}; `roboeval tasks {new} --suite {suite}` shows it")
        return
    known = load(suite)
    if lint:
        lint_tasks(known, task)
    elif task is not None:
        print_rich(task_view(known.task(task)))
    elif json:
        print_json(suite_data(known))
    else:
        print_rich(suite_view(known))


@app.command()
def export(
    run: Annotated[Path, typer.Argument(help="A run.")],
    format: Annotated[str, typer.Option(help="csv or parquet.")] = "csv",  # noqa: A002 - the option's name
    out: Annotated[Path | None, typer.Option(help="The file; by default beside the verdicts.")] = None,
    suite: SuiteOption = "paper",
    ablation: AblationOption = False,
) -> None:
    """Write a run's verdicts as one flat table."""
    from roboeval.export import table, write
    from roboeval.run import Run, evaluation_key

    judged_by = load(suite)
    rows, completions = read_evaluation(run, judged_by, ablated=ablation)
    key = evaluation_key(judged_by, ablated=ablation)
    path = out or Run(run).rows(key).with_suffix(f".{format}")
    write(table(rows, completions), path, format)
    note(f"the table is in {path}")


@app.command("import")
def import_(
    path: Annotated[str, typer.Argument(help="A .jsonl, or a folder or zip of .py completions.")],
    out: Annotated[Path, typer.Option(help="The run to make.")],
    suite: SuiteOption = "paper",
) -> None:
    """Make a run of completions from elsewhere."""
    from roboeval.run import Run, open_source

    known = load(suite)
    source = open_source(path, known)
    run = Run(out)
    with run.writing():
        run.keep(source, known)
    note(f"{sum(1 for _ in source.read()):,} completions are in {out}; `roboeval evaluate {out}` judges them")


def refuse_what_comes_later(suite: str, worlds: int | None, engine: str) -> None:
    """End with a sentence about options that are promised and not there yet."""
    if worlds is not None or engine != "local":
        asked = f"--engine {engine}" if worlds is None else "--worlds"
        fail(f"{asked} is not there yet; leave it out to judge in the suite's own worlds, on this machine")
    if suite == "plus" and not Path(suite).exists():
        fail('the suite "plus" is not there yet; leave --suite out to judge by the suite of the paper')


def load(suite: str) -> Suite:
    """Read a suite by name or folder."""
    from roboeval.suite import load_suite

    return load_suite(suite)


def read_evaluation(
    run: Path, suite: Suite, *, ablated: bool
) -> tuple[list[dict[str, Any]], list[Completion]]:
    """A run's rows and the completions they judge."""
    from codebotler.badinput import BadInput
    from roboeval.records import read_completions, read_evaluations
    from roboeval.run import Run, evaluation_key, load_head

    folder, key = Run(run), evaluation_key(suite, ablated=ablated)
    if not folder.completions.is_file():
        raise BadInput("is no run: it holds no completions.jsonl", file=run)
    if not folder.rows(key).is_file():
        flag = " --ablation" if ablated else ""
        raise BadInput(f"has not been judged; `roboeval evaluate {run}{flag}` does it", file=run)
    if load_head(folder.head(key)).get("digest") != suite.digest:
        note("the suite has changed since this run was judged; explanations may be missing")
    return [row for _, row in read_evaluations(folder.rows(key))], list(
        read_completions(folder.completions, growing=True)
    )


def print_summary(
    rows: Iterable[dict[str, Any]],
    suite: Suite,
    *,
    title: str,
    ablated: bool,
    as_json: bool,
    k: Sequence[int] = (1,),
) -> None:
    """Print the tables of an evaluation."""
    from roboeval.tables import render, summary, summary_data

    counted = summary(rows, suite, k=k)
    if as_json:
        print_json(summary_data(counted))
    else:
        print_rich(render(counted, title=title, ablated=ablated))


def lint_tasks(suite: Suite, task: str | None) -> None:
    """Print what the linter finds in all tasks or one; status 1 if anything is open."""
    from roboeval.lint import lint, render

    wanted = list(suite.tasks.values()) if task is None else [suite.task(task)]
    linted = (lint(one, suite) for one in wanted)
    findings = [found for several in watched(linted, len(wanted), "linting") for found in several]
    print(render(findings))
    if any(finding.accepted is None for finding in findings):
        raise SystemExit(1)


def print_rich(what: RenderableType) -> None:
    """Draw on the terminal, or plainly into a pipe."""
    from rich.console import Console

    console = Console()
    if console.is_terminal:
        console.print(what)
        return
    with console.capture() as drawn:
        console.print(what)
    print("\n".join(line.rstrip() for line in drawn.get().splitlines()))


def print_json(data: object) -> None:
    """Print for machines."""
    import json

    print(json.dumps(data, indent=2))


def watched(rows: Iterable[Item], total: int, doing: str = "judging") -> Iterator[Item]:
    """Pass things on, with a progress bar on a terminal and a line now and then elsewhere."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn(doing), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        job = progress.add_task(doing, total=total)
        for done, row in enumerate(rows, 1):
            progress.update(job, completed=done)
            if not console.is_terminal and done % 1000 == 0:
                note(f"{doing}: {done:,} of {total:,}")
            yield row


def cores() -> int:
    """How many programs to run at the same time."""
    return os.cpu_count() or 1


def note(sentence: str) -> None:
    """Say something beside the results."""
    print(sentence, file=sys.stderr)


def fail(sentence: str) -> NoReturn:
    """End with a sentence about what the user asked for."""
    note(f"roboeval: {sentence}")
    raise SystemExit(2)


def main() -> None:
    """Run the command line; what a user can cause ends in one sentence and status 2."""
    try:
        app()
    except KeyboardInterrupt:
        note("roboeval: stopped; the same command goes on where it was")
        raise SystemExit(130) from None
    except Exception as error:
        from codebotler.badinput import BadInput
        from codebotler.simulator.engine import EngineError

        if isinstance(error, BadInput):
            fail(str(error))
        if isinstance(error, EngineError):
            note(f"roboeval: {error}")
            raise SystemExit(1) from None
        raise


if __name__ == "__main__":
    main()
