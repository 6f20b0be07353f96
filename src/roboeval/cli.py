"""The command line of RoboEval; what a command needs is imported when it runs, so that help is quick."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict

import typer

from codebotler import __version__
from codebotler.cli import STOPPED, obey
from roboeval.terminal import fail, note, print_json, print_rich, watched

if TYPE_CHECKING:
    from roboeval.evaluation import Evaluation, Scope
    from roboeval.records import Key
    from roboeval.suite import Suite

app = typer.Typer(
    rich_markup_mode=None,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def named(what: str) -> Callable[[str], Path]:
    """A reader of paths that refuses the empty one, which would be the current folder."""

    def path(text: str) -> Path:
        return Path(text) if text else fail(f"nothing is named; name {what}")

    return path


RunArgument = Annotated[Path, typer.Argument(help="A run.", parser=named("a run"))]
SuiteOption = Annotated[str, typer.Option(help="A suite that ships with the package, or a folder.")]
TasksOption = Annotated[str | None, typer.Option(help="Only these tasks, separated by commas.")]
AblationOption = Annotated[bool, typer.Option("--ablation", help="Require common sense only.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]


@app.callback(invoke_without_command=True)
def roboeval(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """How good are language models at writing programs for service robots?"""
    if version:
        print(f"roboeval {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command()
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
    from roboeval.evaluation import Scope
    from roboeval.resume import evaluate_run
    from roboeval.run import Run, open_source, tasks_to_judge

    refuse_what_comes_later(worlds, engine)
    judged_by = load(suite)
    wanted, left = tasks_to_judge(judged_by, tasks, ablated=ablation)
    if left:
        note(f"without ablation, and so not judged: {', '.join(left)}")
    tally = Tally()
    run = None if out is None else Run(out)
    try:
        opened = open_source(source, judged_by)
        run = run or opened.run
        scope = Scope.of(watched(opened.read(), "reading"), wanted)
        if scope.total == 0:
            fail(f"{source}: there is no completion of {tasks or 'a task with an ablation'} in it")
        if run is not None and (opened.run is None or run.path.resolve() != opened.run.path.resolve()):
            run.keep(opened)
        how = How(ablated=ablation, workers=workers or cores(), require_isolation=require_isolation)
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
        again = command("show", run.path, *tally.first_failed, suite=suite, ablated=ablation)
        does = "says why that one fails" if tally.first_failed else "prints these tables again"
        note(f"verdicts are in {run.path}; `{again}` {does}")


@app.command()
def show(
    run: RunArgument,
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


@app.command()
def tasks(
    task: Annotated[str | None, typer.Argument(help="Show this task.")] = None,
    suite: SuiteOption = "paper",
    lint: Annotated[bool, typer.Option("--lint", help="Look for faults; status 1 if there are any.")] = False,
    accepted: Annotated[
        bool, typer.Option("--accepted", help="With --lint: also what the task files accept, and why.")
    ] = False,
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
    if accepted and not lint:
        fail("--accepted is about what --lint finds; add --lint")
    known = load(suite)
    if lint:
        if json:
            fail("--lint prints for people only; leave --json out")
        lint_tasks(known, task, accepted=accepted)
    elif json:
        print_json(suite_data(known, None if task is None else known.task(task).name))
    elif task is not None:
        print_rich(task_view(known.task(task)))
    else:
        print_rich(suite_view(known))


@app.command()
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
    from roboeval.export import kind_of, table, write
    from roboeval.run import Run, evaluation_key

    kind = format or kind_of(out)
    judged_by = load(suite)
    evaluation = open_evaluation(run, judged_by, suite, ablated=ablation)
    frame = table(watched(evaluation.rows(), "reading", evaluation.scope.total), evaluation.judged())
    again = command("evaluate", run, *options_of(evaluation, judged_by), suite=suite, ablated=ablation)
    if (complaint := evaluation.complaint()) is not None:
        raise BadInput(f"{complaint}; `{again} --redo` judges what stands there")
    if (unfinished := evaluation.unfinished()) is not None:
        note(f"{unfinished}, and only these are in the table; `{again}` goes on")
    path = out or Run(run).rows(evaluation_key(judged_by, ablated=ablation)).with_suffix(f".{kind}")
    write(frame, path, kind)
    note(f"the table is in {path}")


@app.command("import")
def import_(
    path: Annotated[str, typer.Argument(help="A .jsonl, or a folder or zip of .py completions.")],
    out: Annotated[Path, typer.Option(help="The run to make.", parser=named("a run"))],
    suite: SuiteOption = "paper",
) -> None:
    """Make a run of completions from elsewhere."""
    from roboeval.records import how_many
    from roboeval.run import Run, open_source

    known = load(suite)
    count = Run(out).keep(open_source(path, known))
    again = command("evaluate", out, suite=suite)
    they = ("is", "it") if count == 1 else ("are", "them")
    note(f"{how_many(count)} {they[0]} in {out}; `{again}` judges {they[1]}")


def refuse_what_comes_later(worlds: int | None, engine: str) -> None:
    """End with a sentence about options that are promised and not there yet, or never were."""
    if engine not in {"local", "ray"}:
        fail(f'there is no engine "{engine}"; there is local, and ray is not there yet')
    if worlds is not None or engine != "local":
        asked = f"--engine {engine}" if worlds is None else "--worlds"
        fail(f"{asked} is not there yet; leave it out to judge in the suite's own worlds, on this machine")


def load(suite: str) -> Suite:
    """Read a suite by name or folder."""
    from roboeval.suite import load_suite

    if suite == "plus" and not Path(suite).exists():
        fail('the suite "plus" is not there yet; leave --suite out to judge by the suite of the paper')
    return load_suite(suite)


def command(verb: str, *arguments: object, suite: str, ablated: bool = False) -> str:
    """A command for the user to paste."""
    import shlex

    words = ["roboeval", verb, *map(str, arguments)]
    words += [] if suite == "paper" else ["--suite", suite]
    return shlex.join([*words, "--ablation"] if ablated else words)


def options_of(evaluation: Evaluation, suite: Suite) -> list[str]:
    """What else a command needs to go on with an evaluation."""
    from roboeval.run import tasks_to_judge

    tasks = evaluation.scope.tasks
    if tasks in {None, tasks_to_judge(suite, None, ablated=bool(evaluation.head.get("ablation")))[0]}:
        return []
    return ["--tasks", ",".join(sorted(tasks or ()))]


def open_evaluation(run: Path, suite: Suite, suite_name: str, *, ablated: bool) -> Evaluation:
    """An evaluation that a user names."""
    from codebotler.badinput import BadInput
    from roboeval.evaluation import Evaluation
    from roboeval.run import Run, evaluation_key

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


class How(TypedDict):
    """How completions are judged."""

    ablated: bool
    workers: int
    require_isolation: bool


class Tally:
    """Passes rows on, and remembers what there is to say at the end."""

    def __init__(self) -> None:
        self.count = 0
        self.first_failed: tuple[str, ...] = ()

    def of(self, rows: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
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


def print_summary(
    rows: Iterable[dict[str, Any]],
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
    from roboeval.records import name_of
    from roboeval.summary import render, summary, summary_data

    counted = summary(rows, suite, k=k, scope=scope, ablated=ablated)
    if as_json:
        print_json({**summary_data(counted), "stale": list(map(name_of, stale))})
    else:
        print_rich(render(counted, title=title))


def lint_tasks(suite: Suite, task: str | None, *, accepted: bool) -> None:
    """Print what the linter finds in all tasks or one; status 1 if anything is open."""
    from roboeval.findings import render
    from roboeval.lint import lint
    from roboeval.trials import tried

    wanted = list(suite.tasks.values()) if task is None else [suite.task(task)]
    linted = (lint(one, tried(one, suite, workers=cores())) for one in wanted)
    findings = [found for several in watched(linted, "linting", len(wanted)) for found in several]
    print(render(findings, accepted=accepted))
    if any(finding.accepted is None for finding in findings):
        raise SystemExit(1)


def cores() -> int:
    """How many programs to run at the same time."""
    return os.cpu_count() or 1


def main() -> None:
    """Run the command line."""
    obey(app, "roboeval")


if __name__ == "__main__":
    main()
