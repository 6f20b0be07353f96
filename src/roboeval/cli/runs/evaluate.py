"""Defines the commands evaluate, which judges completions, and import, which creates a run from them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codebotler.cli.options import SkillsOption
from codebotler.core.errors import installed
from roboeval.cli.engine_choice import engine_named
from roboeval.cli.inputs import command, load_suite_option
from roboeval.cli.options import (
    AblationOption,
    EngineOption,
    HouseRulesOption,
    IsolationOption,
    JsonOption,
    ProcessOption,
    SourceArgument,
    SuiteOption,
    TasksOption,
    WorkersOption,
    WorldsOption,
    path_to,
)
from roboeval.cli.output import fail, note, progress_meter, show_progress, stoppable
from roboeval.cli.results.show import broken_rules_of, print_summary

if TYPE_CHECKING:
    from roboeval.analysis.counting.summary import EvaluationSummary
    from roboeval.evaluation.engines.engine import OpenEngine
    from roboeval.evaluation.runs.completions import CompletionKey
    from roboeval.evaluation.runs.folder import RunFolder
    from roboeval.evaluation.runs.rows import Row
    from roboeval.evaluation.runs.source import Source
    from roboeval.suites.load import Suite

KeepOption = Annotated[
    Path | None,
    typer.Option(help="Save completions and verdicts in this run folder.", parser=path_to("a run")),
]
RedoOption = Annotated[
    bool, typer.Option("--redo", help="Discard earlier verdicts and judge everything again.")
]
WorldSeedOption = Annotated[
    int | None, typer.Option(min=0, help="Random seed for sampling worlds, instead of the suite's own seed.")
]


def evaluate(
    source: SourceArgument,
    out: KeepOption = None,
    suite: SuiteOption = "paper",
    tasks: TasksOption = None,
    ablation: AblationOption = False,
    redo: RedoOption = False,
    workers: WorkersOption = None,
    worlds: WorldsOption = None,
    seed: WorldSeedOption = None,
    engine: EngineOption = "local",
    require_isolation: IsolationOption = False,
    one_process_per_run: ProcessOption = False,
    rules: HouseRulesOption = None,
    skills: SkillsOption = None,
    json: JsonOption = False,
) -> None:
    """Judge whether each completion does what its prompt asks."""
    isolation = {"require_isolation": require_isolation, "one_process_per_run": one_process_per_run}
    with engine_named(engine, workers, **isolation) as engine_for:
        from roboeval.analysis.counting.counts import Tally, outcome_of
        from roboeval.analysis.counting.summary import summarise
        from roboeval.evaluation.runs.folder import RunFolder, about_of, tasks_to_judge
        from roboeval.evaluation.runs.rows import key_of
        from roboeval.evaluation.runs.scope import JudgingScope
        from roboeval.evaluation.runs.source import open_source

        judged_by = load_suite_option(suite, rules, skills)
        if worlds is not None or seed is not None:
            judged_by = judged_by.with_worlds(worlds, seed)
        wanted, left = tasks_to_judge(judged_by, tasks, ablated=ablation)
        if left:
            note(f"tasks that are not judged because they have no ablation: {', '.join(left)}")
        tally, failed, table = Tally(), None, None
        if rules is not None:
            from roboeval.evaluation.runs.table import TableBuilder  # imports polars, which loads slowly

            table = TableBuilder()
        opened = open_source(source, judged_by)
        run = opened.run if out is None else RunFolder(out)
        again = f"the same command {'without --redo ' * redo}continues where it stopped"
        with stoppable("nothing was saved (add --out RUN to save verdicts)" if run is None else again):
            about = {} if opened.run is None else about_of(opened.run)
            scope = JudgingScope.of(opened.completions, wanted, about, judged_by)
            if scope.total == 0:
                fail(f"{source}: contains no completion of {tasks or 'a task to judge'}; name another source")
            if run is not None and (opened.run is None or run.path.resolve() != opened.run.path.resolve()):
                run.import_completions(opened.completions)
            running = engine_for(scope.total)
            rows = _judged(opened, run, judged_by, wanted, ablated=ablation, redo=redo, engine=running)
            for row in show_progress(rows, "judging", scope.total):
                tally[outcome_of(row)] += 1
                failed = failed or (None if row["passed"] else key_of(row))
                if table is not None:
                    table.add(row)
            counted = summarise(tally, judged_by, scope, ablated=ablation)
            found = None if table is None else table.table()
            house = None if found is None else broken_rules_of(run, judged_by, found, ablated=ablation)
            print_summary(counted, title=source, as_json=json, house=house)
        _name_next_command(run, failed, suite=suite, ablated=ablation, rules=rules)
        _expect_all_judged(counted, scope.total)


def _expect_all_judged(summary: EvaluationSummary, total: int) -> None:
    """Exit with status 1 if some completions could not be judged."""
    from roboeval.evaluation.runs.completions import how_many

    if (left_out := total - summary.judged) > 0:
        note(f"roboeval: not judged: {how_many(left_out)} of {total:,}; the same command tries again")
        raise SystemExit(1)


def _name_next_command(
    run: RunFolder | None, failed: CompletionKey | None, *, suite: str, ablated: bool, rules: Path | None
) -> None:
    from roboeval.evaluation.runs.completions import name_of

    if run is None:
        return
    shown = [] if failed is None else [name_of(failed)]
    again = command("show", run.path, *shown, suite=suite, ablated=ablated, rules=rules)
    does = "explains the first failure" if shown else "prints these tables again"
    note(f"the verdicts are in {run.path}; `{again}` {does}")


def _judged(
    source: Source,
    run: RunFolder | None,
    suite: Suite,
    tasks: frozenset[str] | None,
    *,
    ablated: bool,
    redo: bool,
    engine: OpenEngine,
) -> Iterator[Row]:
    from roboeval.evaluation.evaluate import evaluate_run
    from roboeval.evaluation.judging.judge import evaluate

    if run is not None:
        completions = source.completions
        return evaluate_run(
            run, suite, ablated=ablated, tasks=tasks, redo=redo, engine=engine, completions=completions
        )
    return evaluate(source.of(tasks), suite, ablated=ablated, engine=engine)


def import_(
    path: Annotated[
        str, typer.Argument(help="A .jsonl file, a folder or zip of .py files, or the answers to a batch.")
    ],
    out: Annotated[
        Path,
        typer.Option(
            help="The run folder to create; for answers, the run with the requests.", parser=path_to("a run")
        ),
    ],
    suite: SuiteOption = "paper",
) -> None:
    """Create a run from completions generated elsewhere.

    Answers to requests of `generate --requests` are added to the run they belong to.
    """
    from roboeval.evaluation.runs.completions import how_many
    from roboeval.evaluation.runs.folder import RunFolder
    from roboeval.evaluation.runs.source import is_batch_file, open_source

    if is_batch_file(Path(path)):
        import_batch(Path(path), out, suite)
        return
    completions = open_source(path, load_suite_option(suite)).completions
    RunFolder(out).import_completions(completions)
    again = command("evaluate", out, suite=suite)
    note(f"{out} has {how_many(len(completions))}; `{again}` judges them")


def import_batch(path: Path, out: Path, suite: str) -> None:
    """Add the answers from a batch endpoint to their run. Exit with status 1 if completions are missing."""
    with installed():
        from roboeval.evaluation.generating.batches import import_answers
    from roboeval.evaluation.runs.completions import how_many
    from roboeval.evaluation.runs.folder import RunFolder

    with path.open("rb") as file:
        count = sum(1 for _ in file)
    with progress_meter("reading", count) as update:
        run, read = RunFolder(out), load_suite_option(suite)
        found = import_answers(run, read, path, progress=lambda done: update(done, ""))
    there, again = found.total - found.missing, command("evaluate", out, suite=suite)
    total = how_many(found.total)
    note(f"{there:,} of {total} are in {out}, {found.new:,} of them new; `{again}` judges them")
    if found.missing:
        lacks = f"{how_many(found.missing)} missing: {found.why}"
        note(f"roboeval: {lacks}; `roboeval generate --requests` requests them again")
        raise SystemExit(1)
