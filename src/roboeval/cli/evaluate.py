"""Commands that judge completions, and make a run of those from elsewhere: evaluate, import."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codebotler.cli.ending import STOPPED
from roboeval.cli.options import (
    AblationOption,
    EngineOption,
    IsolationOption,
    JsonOption,
    SuiteOption,
    TasksOption,
    WorkersOption,
    command,
    engine_named,
    load,
    named,
)
from roboeval.cli.output import fail, note, watched
from roboeval.cli.show import print_summary

if TYPE_CHECKING:
    from roboeval.evaluation.engines import OpenEngine
    from roboeval.evaluation.runs.folder import Run, Source
    from roboeval.evaluation.runs.rows import JudgedRow
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
        typer.Option(min=1, max=10_000, help="Draw this many worlds a task, if the suite draws worlds."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Draw the worlds from this seed instead of the suite's own.")
    ] = None,
    engine: EngineOption = "local",
    require_isolation: IsolationOption = False,
    json: JsonOption = False,
) -> None:
    """Judge whether each completion does what was asked."""
    from roboeval.analysis.summary import summary
    from roboeval.evaluation.runs.folder import Run, open_source, tasks_to_judge
    from roboeval.evaluation.runs.results import Scope
    from roboeval.evaluation.runs.table import TableBuilder

    running = engine_named(engine, workers, require_isolation=require_isolation)
    judged_by = load(suite)
    if worlds is not None or seed is not None:
        judged_by = judged_by.with_worlds(worlds, seed)
    wanted, left = tasks_to_judge(judged_by, tasks, ablated=ablation)
    if left:
        note(f"not judged, since they have no ablation: {', '.join(left)}")
    tally = Tally()
    run = None if out is None else Run(out)
    try:
        opened = open_source(source, judged_by)
        run = run or opened.run
        scope = Scope.of(opened.completions, wanted)
        if opened.left_aside is not None:
            note(opened.left_aside)
        if scope.total == 0:
            fail(f"{source}: there is no completion of {tasks or 'a task with an ablation'} in it")
        if run is not None and (opened.run is None or run.path.resolve() != opened.run.path.resolve()):
            run.keep(opened.completions)
        rows = _judged(opened, run, judged_by, wanted, ablated=ablation, redo=redo, engine=running)
        builder = TableBuilder()
        for row in watched(tally.of(rows), "judging", scope.total):
            builder.add(row)
        counted = summary(builder.table(), judged_by, scope, ablated=ablation)
        print_summary(counted, title=source, as_json=json)
    except KeyboardInterrupt:
        note(f"roboeval: {tally.after_a_stop(is_kept=run is not None, redo=redo)}")
        raise SystemExit(STOPPED) from None
    if run is not None:
        tally.say_how_to_look(run.path, suite, ablated=ablation)
    _exit_if_left_out(scope.total - tally.count, scope.total, is_kept=run is not None)


def _exit_if_left_out(left_out: int, total: int, *, is_kept: bool) -> None:
    from roboeval.evaluation.runs.completions import how_many

    if left_out > 0:
        again = "the same command tries again" if is_kept else "the others are judged"
        note(f"roboeval: not judged: {how_many(left_out)} of {total:,}; {again}")
        raise SystemExit(1)


def _judged(
    source: Source,
    run: Run | None,
    suite: Suite,
    tasks: frozenset[str] | None,
    *,
    ablated: bool,
    redo: bool,
    engine: OpenEngine,
) -> Iterator[JudgedRow]:
    """Judge completions, in a run if there is one to keep the rows."""
    from codebotler.core.files import to_line
    from roboeval.evaluation.evaluate import evaluate_run
    from roboeval.evaluation.judge import evaluate as judge_all
    from roboeval.evaluation.runs.rows import judged_row

    if run is not None:
        completions = source.completions
        return evaluate_run(
            run, suite, ablated=ablated, tasks=tasks, redo=redo, engine=engine, completions=completions
        )
    rows = judge_all(source.of(tasks), suite, ablated=ablated, engine=engine)
    return (judged_row(to_line(row)) for row in rows)


def import_(
    path: Annotated[str, typer.Argument(help="A .jsonl, or a folder or zip of .py completions.")],
    out: Annotated[Path, typer.Option(help="The run to make.", parser=named("a run"))],
    suite: SuiteOption = "paper",
) -> None:
    """Make a run from completions written elsewhere."""
    from roboeval.evaluation.runs.completions import how_many
    from roboeval.evaluation.runs.folder import Run, open_source

    known = load(suite)
    opened = open_source(path, known)
    Run(out).keep(opened.completions)
    if opened.left_aside is not None:
        note(opened.left_aside)
    count = len(opened.completions)
    again = command("evaluate", out, suite=suite)
    they = ("is", "it") if count == 1 else ("are", "them")
    note(f"{how_many(count)} {they[0]} in {out}; `{again}` judges {they[1]}")


class Tally:
    """Counts the rows that it passes on."""

    count = 0
    first_failed: tuple[str, ...] = ()  # its name, if any has failed

    def of(self, rows: Iterable[JudgedRow]) -> Iterator[JudgedRow]:
        """Pass rows on."""
        for row in rows:
            self.count += 1
            if not row.passed and not self.first_failed:
                self.first_failed = (f"{row.task}/{row.prompt}/{row.index}",)
            yield row

    def after_a_stop(self, *, is_kept: bool, redo: bool) -> str:
        """What Ctrl-C leaves behind, and how to go on."""
        if not is_kept:
            return "stopped; nothing is kept (add --out RUN to keep verdicts)"
        if self.count == 0:
            return "stopped before judging; run the same command again"
        return f"stopped; the same command {'without --redo ' * redo}continues where it stopped"

    def say_how_to_look(self, run: Path, suite: str, *, ablated: bool) -> None:
        """Note where the verdicts are, and the command that shows more of them."""
        again = command("show", run, *self.first_failed, suite=suite, ablated=ablated)
        does = "says why that program fails" if self.first_failed else "prints these tables again"
        note(f"verdicts are in {run}; `{again}` {does}")
