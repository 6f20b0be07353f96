"""Commands that have a model write programs: generate, and run, which judges and reports as well."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Self

import typer

from codebotler.cli import STOPPED
from codebotler.options import (
    BaseUrlOption,
    MaxTokensOption,
    ModelOption,
    SeedOption,
    TemperatureOption,
    TimeoutOption,
    TopPOption,
)
from roboeval.cli.evaluate import evaluate
from roboeval.cli.options import (
    IsolationOption,
    JsonOption,
    SuiteOption,
    TasksOption,
    WorkersOption,
    command,
    load,
    named,
)
from roboeval.cli.output import metered, note
from roboeval.cli.report import report

if TYPE_CHECKING:
    from roboeval.evaluation.generate import Progress

OutOption = Annotated[
    Path | None, typer.Option(help="The run; by default runs/MODEL.", parser=named("a run"))
]
NumOption = Annotated[int, typer.Option(min=1, max=10_000, help="Completions for each prompt.")]
ConcurrencyOption = Annotated[int, typer.Option(min=1, help="Requests under way at the same time.")]
RateOption = Annotated[float | None, typer.Option(min=0.001, help="Send no more requests in a minute.")]
BudgetOption = Annotated[
    int | None, typer.Option(min=1, help="Stop when this command has used so many tokens.")
]


def generate(
    model: ModelOption = "recorded",
    out: OutOption = None,
    num_completions: NumOption = 50,
    temperature: TemperatureOption = 0.2,
    top_p: TopPOption = 0.95,
    max_tokens: MaxTokensOption = 512,
    seed: SeedOption = None,
    suite: SuiteOption = "paper",
    tasks: TasksOption = None,
    concurrency: ConcurrencyOption = 8,
    requests_per_minute: RateOption = None,
    token_budget: BudgetOption = None,
    timeout: TimeoutOption = 60.0,
    base_url: BaseUrlOption = None,
) -> None:
    """Have a model write programs for a suite.

    The same command goes on after any interruption.
    """
    path = generated(
        model,
        out,
        num_completions,
        temperature,
        top_p,
        max_tokens,
        seed,
        suite,
        tasks,
        concurrency,
        requests_per_minute,
        token_budget,
        timeout,
        base_url,
    )
    note(f"the completions are in {path}; `{command('evaluate', path, suite=suite)}` judges them")


def run(
    model: ModelOption = "recorded",
    out: OutOption = None,
    num_completions: NumOption = 50,
    temperature: TemperatureOption = 0.2,
    top_p: TopPOption = 0.95,
    max_tokens: MaxTokensOption = 512,
    seed: SeedOption = None,
    suite: SuiteOption = "paper",
    tasks: TasksOption = None,
    concurrency: ConcurrencyOption = 8,
    requests_per_minute: RateOption = None,
    token_budget: BudgetOption = None,
    timeout: TimeoutOption = 60.0,
    base_url: BaseUrlOption = None,
    workers: WorkersOption = None,
    require_isolation: IsolationOption = False,
    with_report: Annotated[
        bool, typer.Option("--report/--no-report", help="Write the report, to the folder report of the run.")
    ] = True,
    json: JsonOption = False,
) -> None:
    """Have a model write programs, judge them, write the report.

    The tables are printed, and the same command goes on after any interruption.
    """
    path = generated(
        model,
        out,
        num_completions,
        temperature,
        top_p,
        max_tokens,
        seed,
        suite,
        tasks,
        concurrency,
        requests_per_minute,
        token_budget,
        timeout,
        base_url,
    )
    evaluate(
        str(path),
        suite=suite,
        tasks=tasks,
        workers=workers,
        require_isolation=require_isolation,
        json=json,
    )
    if with_report:
        reported(path, suite, workers)


def reported(path: Path, suite: str, workers: int | None) -> None:
    """Write the report of a run into it; ends with a sentence if that is interrupted."""
    out = path / "report"
    try:
        report([path], out, suite=suite, workers=workers)
    except KeyboardInterrupt:
        again = command("report", path, "--out", out, suite=suite)
        note(f"roboeval: stopped; verdicts are in {path}; `{again}` writes the report")
        raise SystemExit(STOPPED) from None


def generated(
    name: str,
    out: Path | None,
    num_completions: int,
    temperature: float,
    top_p: float,
    max_tokens: int,
    seed: int | None,
    suite: str,
    tasks: str | None,
    concurrency: int,
    requests_per_minute: float | None,
    token_budget: int | None,
    timeout: float,
    base_url: str | None,
) -> Path:
    """Make or complete a run, and say where it is; ends with status 1 if completions are missing."""
    from codebotler.models.base import Settings
    from codebotler.models.open import open_model
    from roboeval.evaluation.generate import Pace, generate_run
    from roboeval.evaluation.order import Order
    from roboeval.evaluation.run import Run, tasks_to_judge

    known = load(suite)
    order = Order(known, tasks_to_judge(known, tasks, ablated=False)[0], num_completions)
    settings = Settings(temperature, top_p, max_tokens, seed, timeout, base_url)
    pace = Pace(concurrency, requests_per_minute, token_budget)
    model = open_model(name, settings)
    run = Run(out or Path("runs", re.sub(r"[^\w.]+", "-", model.name).strip("-.")))
    meter = Meter()
    try:
        with meter:
            progress = generate_run(run, order, model, settings, pace, begun=meter.begin, told=meter.tell)
    except KeyboardInterrupt:
        note(f"roboeval: {meter.after_a_stop()}")
        raise SystemExit(STOPPED) from None
    if progress.missing is not None:
        note(f"roboeval: {progress.missing}; the same command goes on where it was")
        raise SystemExit(1)
    return run.path


class Meter:
    """Tells how far a run has come: how fast, with how many tokens, and how long the rest takes."""

    def __init__(self) -> None:
        self._bar = ExitStack()
        self._draw: Callable[[int, str], None] | None = None
        self._progress: Progress | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def begin(self, progress: Progress) -> None:
        """Say what there is already, and start the bar."""
        from roboeval.evaluation.completions import how_many

        self._progress = progress
        if progress.found:
            note(f"{progress.found:,} of {how_many(progress.total)} are there already")
        if progress.twice:
            note(f"{requests(progress.twice)} under way when this was interrupted, which may be paid twice")
        self._draw = self._bar.enter_context(metered("generating", progress.total, progress.found))

    def tell(self, progress: Progress) -> None:
        """Show how far it has come."""
        if self._draw is not None:
            self._draw(progress.done, state(progress))

    def after_a_stop(self) -> str:
        """What Ctrl-C left behind, and how to go on."""
        from roboeval.evaluation.completions import how_many

        if self._progress is None:
            return "stopped before the first request; give the same command again"
        kept = f"{self._progress.done:,} of {how_many(self._progress.total)} are kept"
        lost = self._progress.under_way
        paid = f"; {requests(lost)} under way, which may be paid twice" if lost else ""
        return f"stopped; {kept}{paid}; the same command goes on where it was"


def requests(count: int) -> str:
    """Such as `1 request was` or `8 requests were`."""
    return "1 request was" if count == 1 else f"{count:,} requests were"


def state(progress: Progress) -> str:
    """How fast a run grows, and with how many tokens so far."""
    tokens = f"{progress.used.total:,} tokens" if progress.used.total else ""
    return ", ".join(filter(None, (f"{progress.rate:.1f} a second", tokens)))
