"""Defines the commands generate, and run, which also evaluates and reports."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from codebotler.cli.model_options import inherit_options, model_settings, note_unsent
from codebotler.cli.options import BaseUrlOption, ModelOption, WithinOption, read_within
from codebotler.core.errors import install_command, installed
from codebotler.core.text.words import counted
from roboeval.cli.engine_choice import engine_named
from roboeval.cli.inputs import command, load_suite_option
from roboeval.cli.options import (
    ConcurrencyOption,
    IsolationOption,
    JsonOption,
    ProcessOption,
    SuiteOption,
    TasksOption,
    TurnsOption,
    WorkersOption,
    path_to,
)
from roboeval.cli.output import fail, note, progress_meter, stoppable
from roboeval.cli.results.compare import check_completions
from roboeval.cli.results.report import report
from roboeval.cli.runs.evaluate import evaluate

if TYPE_CHECKING:
    from codebotler.models.base import Model
    from codebotler.models.sampling import SamplingSettings
    from codebotler.models.servers.batch import BatchModel
    from roboeval.evaluation.generating.generate import GenerationProgress, Pace
    from roboeval.evaluation.generating.requests import GenerationPlan
    from roboeval.evaluation.runs.folder import RunFolder


@dataclass(frozen=True)
class GenerationRequest:
    """The parsed options of a command: which completions to generate, with which model, in which folder."""

    name: str  # the name of the model
    settings: SamplingSettings
    plan: GenerationPlan
    pace: Pace
    suite: str  # the value of --suite
    out: Path | None

    def run_of(self, model: Model | BatchModel) -> RunFolder:
        """Return the run folder given by --out, or else one named after the model."""
        from roboeval.evaluation.runs.folder import RunFolder

        folder = re.sub(r"[^\w.]+", "-", model.name).strip("-.")
        folder += "".join(f"-{mode}" for name, mode in self.plan.describe().items() if name == "mode")
        fresh = self.plan.suite.is_generated
        return RunFolder(self.out or Path("runs", f"{folder}-{self.suite}" if fresh else folder))

    def open(self) -> Model:
        """Open the model by its name. A recorded model replies with stored programs and needs no network."""
        from codebotler.models.open import open_model
        from codebotler.models.recorded import is_recorded
        from roboeval.evaluation.runs.source import recorded_model_for

        if is_recorded(self.name) and self.settings.base_url is None:
            return recorded_model_for(self.name, self.plan.suite)
        return open_model(self.name, self.settings)


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


@inherit_options(model_settings)
def read_options(
    model: ModelOption = None,
    out: Annotated[
        Path | None, typer.Option(help="The run folder; by default runs/MODEL.", parser=path_to("a run"))
    ] = None,
    num_completions: NumOption = None,
    mode: ModeOption = "program",
    max_turns: TurnsOption = None,
    max_mission_tokens: Annotated[
        int | None, typer.Option(min=1, help="With --mode: the maximum number of tokens of a mission.")
    ] = None,
    within: WithinOption = None,
    suite: SuiteOption = "paper",
    tasks: TasksOption = None,
    concurrency: ConcurrencyOption = 8,
    requests_per_minute: Annotated[
        float | None, typer.Option(min=0.001, help="Maximum number of requests per minute.")
    ] = None,
    token_budget: Annotated[
        int | None, typer.Option(min=1, help="Stop after using this many tokens.")
    ] = None,
    base_url: BaseUrlOption = None,
    **sampling: Any,  # noqa: ANN401 - of several kinds
) -> GenerationRequest:
    """Read the options that `generate` and `run` share. Exit with status 2 if they conflict."""
    from codebotler.models.open import KINDS_WITHOUT_TOOLS, choose_model, kind_of
    from roboeval.evaluation.agents.conversation import TurnLimits
    from roboeval.evaluation.agents.plan import DEFAULT_TURNS, AgentPlan
    from roboeval.evaluation.generating.generate import Pace
    from roboeval.evaluation.generating.requests import GenerationPlan
    from roboeval.evaluation.runs.folder import tasks_to_judge

    chosen = choose_model(model, base_url)
    settings = chosen.add_server(model_settings(**sampling))
    pace = Pace(concurrency, requests_per_minute, token_budget)
    known = load_suite_option(suite)
    selected = tasks_to_judge(known, tasks, ablated=False)[0]
    plan = GenerationPlan(known, selected, num_completions or 50)
    if mode != "program":
        limits = TurnLimits(max_turns or DEFAULT_TURNS[mode], max_mission_tokens)
        contract, count = read_within(within, known.skills), num_completions or 1
        plan = AgentPlan(known, selected, count, mode=mode, limits=limits, contract=contract)
    elif max_turns or max_mission_tokens or within:
        fail("--max-turns, --max-mission-tokens and --within need --mode agent or --mode replan; add one")
    if mode == "replan" and kind_of(chosen.name) == "recorded":
        fail(f"{chosen.name} cannot continue a failed mission; for --mode replan, name a language model")
    if mode == "agent" and kind_of(chosen.name) in KINDS_WITHOUT_TOOLS:
        fail(f"{chosen.name} cannot call tools; --mode agent needs a chat model, such as openai-chat:NAME")
    return GenerationRequest(chosen.name, settings, plan, pace, suite, out)


def complete_run(run: RunFolder, plan: GenerationPlan, model: Model, pace: Pace) -> Path:
    """Generate a run's missing completions, and return its folder. Exit with status 1 if some remain."""
    from codebotler.models.recorded import RECORDED_NOTICE, is_recorded
    from roboeval.evaluation.generating.generate import generate_run

    with stoppable(), GenerationMeter() as meter:
        progress = generate_run(run, plan, model, pace, on_progress=meter.show)
    if progress.missing is not None:
        note(f"roboeval: {progress.missing}; the same command continues where it stopped")
        raise SystemExit(1)
    if is_recorded(model.name):
        note(RECORDED_NOTICE)
    return run.path


@inherit_options(read_options)
def generate(
    *,
    requests: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the requests to this file for a batch endpoint; query no model.",
            parser=path_to("a file"),
        ),
    ] = None,
    **options: Any,  # noqa: ANN401 - of several kinds
) -> None:
    """Let a model write programs for a suite.

    If generation is interrupted, the same command continues it.
    """
    what = read_options(**options)
    if requests is not None:
        if what.plan.has_turns:
            fail("--requests does not work with --mode, whose requests depend on replies; leave one out")
        write_batch(what, requests)
        return
    model = what.open()
    note_unsent(what.settings, model)
    path = complete_run(what.run_of(model), what.plan, model, what.pace)
    note(f"the completions are in {path}; `{command('evaluate', path, suite=what.suite)}` judges them")


def write_batch(what: GenerationRequest, path: Path) -> None:
    """Write the requests of a run to a file for a batch endpoint, and print the next command."""
    with installed():
        from codebotler.models.servers.batch import BatchModel
    from roboeval.evaluation.generating.batches import write_requests

    with closing(BatchModel(what.name, what.settings)) as model:
        note_unsent(what.settings, model)
        run = what.run_of(model)
        with progress_meter("writing", len(what.plan.keys())) as update:
            count = write_requests(run, what.plan, model, path, progress=lambda done: update(done, ""))
    again = command("import", "ANSWERS.jsonl", "--out", run.path, suite=what.suite)
    note(f"{counted(count, 'request')} {'is' if count == 1 else 'are'} in {path}; `{again}` adds answers")


@inherit_options(read_options)
def run(
    *,
    tasks: TasksOption = None,
    workers: WorkersOption = None,
    require_isolation: IsolationOption = False,
    one_process_per_run: ProcessOption = False,
    with_report: Annotated[
        bool,
        typer.Option("--report/--no-report", help="Write a report to the subfolder `report` of the run."),
    ] = True,
    repair: Annotated[
        int, typer.Option(min=0, help="Number of rounds in which the model repairs rejected programs.")
    ] = 0,
    retries: Annotated[
        int, typer.Option(min=0, help="Number of rounds in which rejected programs are regenerated.")
    ] = 0,
    json: JsonOption = False,
    **options: Any,  # noqa: ANN401 - of several kinds
) -> None:
    """Let a model write programs, judge them, and write a report.

    The tables are also printed. If the command is interrupted, run it again to continue.
    """
    if with_report and find_spec("matplotlib") is None:  # check this before requests cost money
        fail(f"the report needs matplotlib; {install_command('matplotlib')}, or use --no-report")
    from roboeval.evaluation.evaluate import expect_same_judge

    what = read_options(tasks=tasks, **options)
    expect_rounds_fit(what.plan, repair, retries, as_json=json)
    suite, plan, model = what.suite, what.plan, what.open()
    note_unsent(what.settings, model)
    first = what.run_of(model)
    expect_same_judge(first, plan.suite, ablated=False)  # check this before requests cost money

    def judge(path: Path) -> Path:
        evaluate(
            str(path),
            suite=suite,
            tasks=tasks,
            workers=workers,
            require_isolation=require_isolation,
            one_process_per_run=one_process_per_run,
            json=json,
        )
        return path

    path = judge(complete_run(first, plan, model, what.pace))
    most = repair or retries
    rounds = further_rounds(
        what, first, most, repairs=bool(repair), workers=workers, require_isolation=require_isolation
    )
    paths = [path, *map(judge, rounds)]
    if with_report:
        with stoppable():
            report(paths, path / "report", suite=suite, workers=workers)


def further_rounds(
    what: GenerationRequest,
    run: RunFolder,
    most: int,
    *,
    repairs: bool,
    workers: int | None,
    require_isolation: bool,
) -> Iterator[Path]:
    """Repair (if `repairs`) or regenerate rejected programs in up to `most` rounds; yield each run folder.

    The rounds end early if the check accepts all programs. Exit with status 1 if completions are missing.
    """
    from roboeval.evaluation.generating.requests import RoundPlan

    plan, latest = what.plan, run
    planned = {*plan.keys()}
    for number in range(1, most + 1):
        completions = {one.key: one for one in latest.read(plan.suite) if one.key in planned}
        with engine_named("local", workers, require_isolation=require_isolation) as engine_for:
            found = check_completions(latest, plan.suite, completions.values(), engine_for(0))
        each = {key: found[one.task, one.program_sha256] for key, one in completions.items()}
        problems = {key: listed for key, listed in each.items() if listed}
        if not problems:
            return
        rejected = counted(len(problems), "completion")
        note(f"round {number}: the check rejects {rejected} of {len(planned):,}")
        same = plan.suite, plan.tasks, plan.num_completions
        following = RoundPlan(*same, number=number, repairs=repairs, earlier=completions, problems=problems)
        latest = following.folder(run)
        yield complete_run(latest, following, what.open(), what.pace)


def expect_rounds_fit(plan: GenerationPlan, repair: int, retries: int, *, as_json: bool) -> None:
    """Exit with status 2 if --repair or --retries is combined with the other, with --json or with --mode."""
    if repair and retries:
        fail("--repair and --retries cannot be combined; use one of them")
    if as_json and (repair or retries):
        fail("--json does not work with --repair or --retries; run `evaluate --json` on each round's folder")
    if plan.has_turns and (repair or retries):
        fail("--repair and --retries do not work with --mode; leave out --mode, or use neither of them")


class GenerationMeter(ExitStack):
    """Shows the progress of generating a run: completions, tokens and the remaining time."""

    progress: GenerationProgress | None = None

    def show(self, progress: GenerationProgress) -> None:
        """Update the progress bar. The first call starts it, and says how many completions already exist."""
        if self.progress is None:
            self.progress = progress
            if progress.found:
                note(f"{progress.found:,} of {counted(progress.total, 'completion')} already exist")
            if progress.interrupted:
                note(f"{counted(progress.interrupted, 'pending request')} may be billed twice")
            self._draw = self.enter_context(progress_meter("generating", progress.total, progress.found))
        else:
            tokens = progress.usage.total()
            self._draw(progress.done, f"{tokens:,} tokens" if tokens else "")
