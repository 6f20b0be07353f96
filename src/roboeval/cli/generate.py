"""The commands generate and run; run evaluates and reports as well."""

from __future__ import annotations

import re
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from codebotler.cli.ending import STOPPED
from codebotler.cli.model_options import model_settings, note_unsent, with_options_of
from codebotler.cli.options import (
    BaseUrlOption,
    ModelOption,
)
from codebotler.core.errors import install_command
from codebotler.core.words import counted
from roboeval.cli.evaluate import evaluate
from roboeval.cli.options import (
    BudgetOption,
    ConcurrencyOption,
    FamiliesOption,
    IsolationOption,
    JsonOption,
    NumOption,
    NumTasksOption,
    OutOption,
    ProcessOption,
    RateOption,
    SuiteOption,
    TasksOption,
    WorkersOption,
    command,
    load,
    suite_of_families,
)
from roboeval.cli.output import fail, metered, note
from roboeval.cli.report import report

if TYPE_CHECKING:
    from codebotler.models.base import Model
    from roboeval.evaluation.generate import Pace, Progress
    from roboeval.evaluation.requests import GenerationPlan
    from roboeval.evaluation.runs.folder import Run


class Requested(NamedTuple):
    """A run, with the completions that it should have, and the model that writes them."""

    run: Run
    plan: GenerationPlan
    model: Model
    pace: Pace
    suite: str  # as --suite takes it


@with_options_of(model_settings)
def requested(
    model: ModelOption = None,
    out: OutOption = None,
    num_completions: NumOption = 50,
    suite: SuiteOption = "paper",
    families: FamiliesOption = None,
    num_tasks: NumTasksOption = None,
    tasks: TasksOption = None,
    concurrency: ConcurrencyOption = 8,
    requests_per_minute: RateOption = None,
    token_budget: BudgetOption = None,
    base_url: BaseUrlOption = None,
    **sampling: Any,  # noqa: ANN401 - of several kinds
) -> Requested:
    """The run that options name, with the completions that it should have, and the model that writes them."""
    from codebotler.models.chosen import chosen_model
    from codebotler.models.open import open_model
    from codebotler.models.recorded import is_recorded
    from roboeval.evaluation.generate import Pace
    from roboeval.evaluation.requests import GenerationPlan
    from roboeval.evaluation.runs.folder import Run, tasks_to_judge
    from roboeval.evaluation.runs.source import recorded_model_for

    if families is not None or num_tasks is not None:
        suite = suite_of_families(suite, families, num_tasks, sampling["seed"])
        sampling["seed"] = None
    chosen = chosen_model(model, base_url)
    settings = chosen.with_its_server(model_settings(**sampling))
    pace = Pace(concurrency, requests_per_minute, token_budget)
    known = load(suite)
    plan = GenerationPlan(known, tasks_to_judge(known, tasks, ablated=False)[0], num_completions)
    knows_more = is_recorded(chosen.name) and chosen.base_url is None
    opened = recorded_model_for(chosen.name, known) if knows_more else open_model(chosen.name, settings)
    note_unsent(settings, opened)
    folder = re.sub(r"[^\w.]+", "-", opened.name).strip("-.")
    run = Run(out or Path("runs", folder if known.families is None else f"{folder}-{suite}"))
    return Requested(run, plan, opened, pace, suite)


def complete(requested: Requested) -> Path:
    """Make or complete a run, and return its folder; exit with status 1 if completions are missing."""
    from codebotler.models.recorded import NOTICE, is_recorded
    from roboeval.evaluation.generate import generate_run

    run, plan, model, pace, _ = requested
    meter = Meter()
    try:
        with meter:
            progress = generate_run(run, plan, model, pace, on_progress=meter.show)
    except KeyboardInterrupt:
        note(f"roboeval: {meter.after_a_stop()}")
        raise SystemExit(STOPPED) from None
    if progress.missing is not None:
        note(f"roboeval: {progress.missing}; the same command continues where it stopped")
        raise SystemExit(1)
    if is_recorded(model.name):
        note(NOTICE)
    return run.path


@with_options_of(requested)
def generate(**options: Any) -> None:  # noqa: ANN401 - of several kinds
    """Have a model write programs for a suite.

    After an interruption, the same command continues.
    """
    what = requested(**options)
    path = complete(what)
    note(f"the completions are in {path}; `{command('evaluate', path, suite=what.suite)}` judges them")


@with_options_of(requested)
def run(
    *,
    tasks: TasksOption = None,
    workers: WorkersOption = None,
    require_isolation: IsolationOption = False,
    one_process_per_run: ProcessOption = False,
    with_report: Annotated[
        bool, typer.Option("--report/--no-report", help="Write the report, to the folder report of the run.")
    ] = True,
    json: JsonOption = False,
    **options: Any,  # noqa: ANN401 - of several kinds
) -> None:
    """Have a model write programs, judge them, and write a report.

    It prints the tables. After an interruption, the same command continues.
    """
    if with_report and find_spec("matplotlib") is None:  # before anything is paid for
        fail(f"the report needs matplotlib; {install_command('matplotlib')}, or add --no-report")
    from roboeval.evaluation.evaluate import expect_same_judge

    what = requested(tasks=tasks, **options)
    suite = what.suite
    expect_same_judge(what.run, what.plan.suite)  # before anything is paid for
    path = complete(what)
    evaluate(
        str(path),
        suite=suite,
        tasks=tasks,
        workers=workers,
        require_isolation=require_isolation,
        one_process_per_run=one_process_per_run,
        json=json,
    )
    if not with_report:
        return
    folder = path / "report"
    try:
        report([path], folder, suite=suite, workers=workers)
    except KeyboardInterrupt:
        again = command("report", path, "--out", folder, suite=suite)
        note(f"roboeval: stopped; verdicts are in {path}; `{again}` writes the report")
        raise SystemExit(STOPPED) from None


class Meter(ExitStack):
    """Shows the progress of a run: its rate, its tokens and the time left."""

    progress: Progress | None = None

    def show(self, progress: Progress) -> None:
        """Draw the bar; start it first, and note what was done before."""
        if self.progress is None:
            self.progress = progress
            if progress.found:
                note(f"{progress.found:,} of {counted(progress.total, 'completion')} were there already")
            if progress.interrupted:
                note(f"{under_way(progress.interrupted)} when this was interrupted, which may be paid twice")
            self._draw = self.enter_context(metered("generating", progress.total, progress.found))
        else:
            tokens = progress.usage.total()
            rate = f"{progress.rate:.1f} a second"
            self._draw(progress.done, f"{rate}, {tokens:,} tokens" if tokens else rate)

    def after_a_stop(self) -> str:
        """What Ctrl-C leaves behind, and how to go on."""
        if self.progress is None:
            return "stopped before the first request; run the same command again"
        kept = f"{self.progress.done:,} of {counted(self.progress.total, 'completion')} are kept"
        open_requests = self.progress.under_way
        paid = f"; {under_way(open_requests)}, which may be paid twice" if open_requests else ""
        return f"stopped; {kept}{paid}; the same command continues where it stopped"


def under_way(requests: int) -> str:
    """Such as `1 request was under way`."""
    return f"{counted(requests, 'request')} {'was' if requests == 1 else 'were'} under way"
