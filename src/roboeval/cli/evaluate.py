"""Commands that judge completions and show the verdicts: evaluate, show, export, import."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict

import typer

from codebotler.cli import STOPPED
from roboeval.cli.completion import task_names
from roboeval.cli.options import (
    AblationOption,
    EngineOption,
    IsolationOption,
    JsonOption,
    RunArgument,
    SuiteOption,
    TasksOption,
    WorkersOption,
    as_judged,
    command,
    engine_named,
    load,
    named,
    open_evaluation,
    options_of,
)
from roboeval.cli.output import fail, note, print_json, print_rich, watched

if TYPE_CHECKING:
    from roboeval.evaluation.completions import Key, Row
    from roboeval.evaluation.engines import OpenEngine
    from roboeval.evaluation.evaluation import Scope
    from roboeval.suites.load import Suite


def evaluate(
    source: Annotated[
        str, typer.Argument(help="A run, a .jsonl, a folder or zip of .py completions, or recorded:NAME.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Keep completions and verdicts in this run.", parser=named("a run"))
    ] = None,
    suite: SuiteOption = "paper",
    tasks: TasksOption = None,
    ablation: AblationOption = False,
    redo: Annotated[bool, typer.Option("--redo", help="Start over.")] = False,
    workers: WorkersOption = None,
    worlds: Annotated[
        int | None,
        typer.Option(min=1, max=10_000, help="Draw so many worlds a task, where the suite draws them."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Draw the worlds from this seed instead of the suite's own.")
    ] = None,
    engine: EngineOption = "local",
    require_isolation: IsolationOption = False,
    json: JsonOption = False,
) -> None:
    """Say of every completion whether it does what was asked."""
    from roboeval.evaluation.completions import how_many
    from roboeval.evaluation.evaluate import evaluate_run
    from roboeval.evaluation.evaluation import Scope
    from roboeval.evaluation.judge import evaluate as judge_all
    from roboeval.evaluation.run import Run, open_source, tasks_to_judge

    opened_engine = engine_named(engine, workers, require_isolation=require_isolation)
    judged_by = load(suite)
    if worlds is not None or seed is not None:
        judged_by = judged_by.with_worlds(worlds, seed)
    wanted, left = tasks_to_judge(judged_by, tasks, ablated=ablation)
    if left:
        note(f"without ablation, and so not judged: {', '.join(left)}")
    tally = Tally()
    run = None if out is None else Run(out)
    try:
        opened = open_source(source, judged_by)
        run = run or opened.run
        scope = Scope.of(watched(opened.read(), "reading"), wanted)
        if (aside := opened.passed_over()) is not None:
            note(aside)
        if scope.total == 0:
            fail(f"{source}: there is no completion of {tasks or 'a task with an ablation'} in it")
        if run is not None and (opened.run is None or run.path.resolve() != opened.run.path.resolve()):
            run.keep(opened)
        how = How(ablated=ablation, engine=opened_engine)
        rows = (
            judge_all(opened.of(wanted), judged_by, **how)
            if run is None
            else evaluate_run(run, judged_by, tasks=wanted, redo=redo, **how)
        )
        counted = watched(tally.of(rows), "judging", scope.total)
        print_summary(counted, judged_by, scope, title=source, ablated=ablation, as_json=json)
    except KeyboardInterrupt:
        note(f"roboeval: {tally.after_a_stop(is_kept=run is not None, redo=redo)}")
        raise SystemExit(STOPPED) from None
    if run is not None:
        tally.say_how_to_look(run.path, suite, ablated=ablation)
    if (left_out := scope.total - tally.count) > 0:
        again = "the same command tries again" if run is not None else "the others are judged as always"
        note(f"roboeval: not judged: {how_many(left_out)} of {scope.total:,}; {again}")
        raise SystemExit(1)


def show(
    run: RunArgument,
    what: Annotated[
        str | None,
        typer.Argument(help="TASK, TASK/PROMPT or TASK/PROMPT/INDEX.", autocompletion=task_names),
    ] = None,
    suite: SuiteOption = "paper",
    ablation: AblationOption = False,
    k: Annotated[list[int] | None, typer.Option("--k", min=1, help="Also pass@k for this k.")] = None,
    json: JsonOption = False,
) -> None:
    """Print a run's tables, or show why a completion fails."""
    from roboeval.evaluation.explanation import view, view_data
    from roboeval.evaluation.tables import parse_selection

    judged_by = as_judged(run, load(suite), ablated=ablation)
    evaluation = open_evaluation(run, judged_by, suite, ablated=ablation)
    selection = parse_selection(what, judged_by)
    if selection.task is None:
        ks = sorted({1, *(k or [])})
        rows = watched(evaluation.rows(), "reading", evaluation.scope.total)
        print_summary(
            rows,
            judged_by,
            evaluation.scope,
            title=str(run),
            ablated=ablation,
            as_json=json,
            k=ks,
            stale=evaluation.stale,
        )
    else:
        if k:
            fail(f"--k is about a whole run; leave {selection} out, or --k")
        if ablation:
            note("ablation: only common sense was required")
        selected = selection.rows(watched(evaluation.rows(), "reading", evaluation.scope.total))
        if json:
            data = view_data(selection, selected, evaluation.judged(), judged_by, ablated=ablation)
            print_json({**data, "ablation": ablation})
        else:
            print_rich(view(selection, selected, evaluation.judged(), judged_by, ablated=ablation))
    again = command("evaluate", run, *options_of(evaluation, judged_by), suite=suite, ablated=ablation)
    if (complaint := evaluation.complaint()) is not None:
        note(f"{complaint}; `{again} --redo` judges what stands there")
    if (unfinished := evaluation.unfinished()) is not None:
        note(f"{unfinished}; `{again}` goes on")


def export(
    run: RunArgument,
    format: Annotated[  # noqa: A002 - the option's name
        str | None, typer.Option(help="csv or parquet; by default what --out ends in, or else csv.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The file; by default beside the verdicts.", parser=named("a file"))
    ] = None,
    suite: SuiteOption = "paper",
    ablation: AblationOption = False,
) -> None:
    """Write a run's verdicts as one flat table."""
    from codebotler.badinput import BadInput
    from codebotler.replacing import expect_replaceable
    from roboeval.analysis.export import BEGINNINGS, kind_of, table, write
    from roboeval.evaluation.run import Run, evaluation_key

    kind = format or kind_of(out)
    judged_by = as_judged(run, load(suite), ablated=ablation)
    evaluation = open_evaluation(run, judged_by, suite, ablated=ablation)
    path = out or Run(run).rows(evaluation_key(judged_by, ablated=ablation)).with_suffix(f".{kind}")
    expect_replaceable(path, *BEGINNINGS)
    frame = table(watched(evaluation.rows(), "reading", evaluation.scope.total), evaluation.judged())
    again = command("evaluate", run, *options_of(evaluation, judged_by), suite=suite, ablated=ablation)
    if (complaint := evaluation.complaint()) is not None:
        raise BadInput(f"{complaint}; `{again} --redo` judges what stands there")
    if (unfinished := evaluation.unfinished()) is not None:
        note(f"{unfinished}, and only these are in the table; `{again}` goes on")
    write(frame, path, kind)
    note(f"the table is in {path}")


def import_(
    path: Annotated[str, typer.Argument(help="A .jsonl, or a folder or zip of .py completions.")],
    out: Annotated[Path, typer.Option(help="The run to make.", parser=named("a run"))],
    suite: SuiteOption = "paper",
) -> None:
    """Make a run of completions from elsewhere."""
    from roboeval.evaluation.completions import how_many
    from roboeval.evaluation.run import Run, open_source

    known = load(suite)
    opened = open_source(path, known)
    count = Run(out).keep(opened)
    if (aside := opened.passed_over()) is not None:
        note(aside)
    again = command("evaluate", out, suite=suite)
    they = ("is", "it") if count == 1 else ("are", "them")
    note(f"{how_many(count)} {they[0]} in {out}; `{again}` judges {they[1]}")


class How(TypedDict):
    """How completions are judged."""

    ablated: bool
    engine: OpenEngine


class Tally:
    """Passes rows on, and remembers what there is to say at the end."""

    def __init__(self) -> None:
        self.count = 0
        self.first_failed: tuple[str, ...] = ()

    def of(self, rows: Iterable[Row]) -> Iterator[Row]:
        """Pass rows on."""
        for row in rows:
            self.count += 1
            if not row["passed"] and not self.first_failed:
                self.first_failed = (f"{row['task']}/{row['prompt']}/{row['index']}",)
            yield row

    def after_a_stop(self, *, is_kept: bool, redo: bool) -> str:
        """What Ctrl-C left behind, and how to go on."""
        if not is_kept:
            return "stopped; nothing is kept (with --out RUN, what was judged would be)"
        if self.count == 0:
            return "stopped before judging; give the same command again"
        return f"stopped; the same command {'without --redo ' * redo}goes on where it was"

    def say_how_to_look(self, run: Path, suite: str, *, ablated: bool) -> None:
        """Where the verdicts are, and what shows more of them."""
        again = command("show", run, *self.first_failed, suite=suite, ablated=ablated)
        does = "says why that one fails" if self.first_failed else "prints these tables again"
        note(f"verdicts are in {run}; `{again}` {does}")


def print_summary(
    rows: Iterable[Row],
    suite: Suite,
    scope: Scope,
    *,
    title: str,
    ablated: bool,
    as_json: bool,
    k: Sequence[int] = (1,),
    stale: Iterable[Key] = (),
) -> None:
    """Print the tables of an evaluation."""
    from roboeval.analysis.summary import render, summary, summary_data
    from roboeval.evaluation.completions import name_of

    counted = summary(rows, suite, k=k, scope=scope, ablated=ablated)
    if as_json:
        print_json({**summary_data(counted), "stale": list(map(name_of, stale))})
    else:
        print_rich(render(counted, title=title))
