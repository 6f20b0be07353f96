"""Defines the command recover, which measures how a model continues missions that ended early."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from codebotler.cli.model_options import inherit_options, model_settings, note_unsent
from codebotler.cli.options import BaseUrlOption, ModelOption
from roboeval.cli.inputs import load_suite_option
from roboeval.cli.options import ConcurrencyOption, JsonOption, SuiteOption, TasksOption
from roboeval.cli.output import fail, print_json, print_rich, progress_meter, show_progress

if TYPE_CHECKING:
    from rich.console import RenderableType

    from roboeval.evaluation.recovery import FaultResult


@inherit_options(model_settings)
def recover(
    source: Annotated[
        str, typer.Argument(help="The programs to interrupt: a run, or any source that `evaluate` reads.")
    ] = "recorded:careful",
    *,
    model: ModelOption = None,
    base_url: BaseUrlOption = None,
    suite: SuiteOption = "paper",
    tasks: TasksOption = None,
    concurrency: ConcurrencyOption = 8,
    json: JsonOption = False,
    **sampling: Any,  # noqa: ANN401 - of several kinds
) -> None:
    """Make skill calls fail, and judge how a model continues.

    For each task, the first right program runs several times in each world. Each time, another call fails.
    """
    from codebotler.core.text.words import counted
    from codebotler.models.open import choose_model, open_model
    from codebotler.models.recorded import is_recorded
    from codebotler.simulator.worker import Worker
    from roboeval.evaluation.recovery import (
        FaultResult,
        find_first_right,
        recovery_data,
        try_continuation,
        write_continuations,
    )
    from roboeval.evaluation.runs.folder import tasks_to_judge
    from roboeval.evaluation.runs.source import open_source, recorded_model_for

    known, chosen = load_suite_option(suite), choose_model(model, base_url)
    completions = open_source(source, known).of(tasks_to_judge(known, tasks, ablated=False)[0])
    if any(one.mission is not None for one in completions):
        fail(f"{source}: contains missions of an agent; name a run of programs")
    settings = chosen.add_server(model_settings(**sampling))
    is_own = is_recorded(chosen.name) and settings.base_url is None
    opened = recorded_model_for(chosen.name, known) if is_own else open_model(chosen.name, settings)
    note_unsent(settings, opened)
    with closing(Worker()) as worker:
        found = show_progress(find_first_right(worker, known, completions), "running", len(completions))
        faults = [one for each in found for one in each]
        if not faults:
            fail(f"{source}: contains no program that passes its task; name a source that has one")
        ended = [one for one in faults if not isinstance(one, FaultResult)]
        prompts = [one.prompt(known) for one in ended]
        with progress_meter("asking", len({*prompts})) as update:
            programs = write_continuations(opened, prompts, concurrency, update)
        tried = (try_continuation(worker, known, *one) for one in zip(ended, programs, strict=True))
        results = list(show_progress(tried, "continuing", len(ended)))
    results += [one for one in faults if isinstance(one, FaultResult)]
    if json:
        data = {"source": source, "model": opened.name, **recovery_data(results)}
        print_json({**data, "missions": list(map(asdict, results))})
    else:
        rests = f"rests for {sum(map(bool, programs))} of {counted(len(ended), 'mission')}"
        print_rich(recovery_view(results, f"{source}, continued by {opened.name}: {rests}"))


def recovery_view(results: Sequence[FaultResult], title: str) -> RenderableType:
    """Return a table of the results, with a row for each task and a total."""
    from rich.console import Group
    from rich.text import Text

    from roboeval.cli.views.results import ruled
    from roboeval.evaluation.recovery import recovery_data

    shares = "passed", "rejected", "failed"
    counts = "faults", "handled", "missing", "continued"
    table = ruled("task", *counts, *shares, "steps", "no fault", "repeated")
    for task in [*dict.fromkeys(one.task for one in results), "all"]:
        data = recovery_data([one for one in results if task in {one.task, "all"}])
        cells = (
            "-" if value is None else f"{value:.3f}" if name in shares else str(value)
            for name, value in data.items()
        )
        table.add_row(task, *cells)
    lines = [
        "faults: calls made to fail, one in each mission; continued: those for which the model had a rest",
        "handled: faults that the program handled itself; missing: missions for which the model had no rest",
        "passed, rejected (by the check), failed: shares of the continued missions, without the missing ones",
        "steps: those of the missions that passed; no fault: those of the same missions without a fault",
        "repeated: how often robots spoke, picked up or put down more than without a fault",
        "--json lists the missions, and why the rest of each was rejected or failed",
    ]
    return Group(Text(title, "bold"), Text(), table, *(Text(line, "dim") for line in lines))
