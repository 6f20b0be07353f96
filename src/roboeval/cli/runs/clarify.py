"""Defines the command clarify, which measures what one question about candidate programs gains."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from statistics import median_high
from typing import TYPE_CHECKING, Annotated, Any

import typer

from codebotler.core.text.words import counted
from roboeval.cli.inputs import load_suite_option
from roboeval.cli.options import HouseRulesOption, JsonOption, SourceArgument, SuiteOption, WorkersOption
from roboeval.cli.output import note, print_json, print_rich, show_progress

if TYPE_CHECKING:
    from rich.console import RenderableType


def clarify(
    source: SourceArgument,
    suite: SuiteOption = "paper",
    candidates: Annotated[
        int | None,
        typer.Option(
            min=2,
            max=20,
            help="Number of programs per question; by default as many as half of the prompts have, up to 10.",
            show_default=False,
        ),
    ] = None,
    noise: Annotated[
        float,
        typer.Option(min=0, max=1, help="Share of questions that the simulated person answers wrongly."),
    ] = 0.0,
    seed: Annotated[int, typer.Option(help="Random seed for candidates and answers.")] = 0,
    rules: HouseRulesOption = None,
    workers: WorkersOption = None,
    json: JsonOption = False,
) -> None:
    """Measure how much one question about candidate programs helps.

    A simulated person chooses among the behaviours of several programs for the same prompt. If the source is
    a run, the result is saved in it for `roboeval report`, except with --rules.
    """
    from codebotler.simulator.pool import WorkerPool, cores
    from roboeval.evaluation.clarify import ClarifySettings, clarify, measurement_data, store_measurement
    from roboeval.evaluation.runs.folder import with_judged_worlds
    from roboeval.evaluation.runs.source import open_source

    known = load_suite_option(suite, rules)
    opened = open_source(source, known)
    completions = opened.of(None)
    if opened.run is not None:
        known = with_judged_worlds(opened.run, known, ablated=False)
    by_prompt = Counter((one.task, one.prompt) for one in completions)
    candidates = candidates or max(2, min(10, median_high(by_prompt.values() or [0])))
    settings, count = ClarifySettings(candidates, noise, seed), len(by_prompt)
    with WorkerPool(workers or cores()) as pool:
        prompts = [*show_progress(clarify(completions, known, pool, settings), "asking", count)]
    data = measurement_data(completions, known, settings, prompts)
    if json:
        print_json(data)
    else:
        some = f", {len(prompts)} of {count} prompts" * (len(prompts) < count)
        print_rich(clarify_view(data, f"{source}{some}", candidates))
    if left_out := count - len(prompts):
        note(f"left out, with fewer than {candidates} completions: {counted(left_out, 'prompt')} of {count}")
    if opened.run is not None and rules is None:
        note(f"the result is in {store_measurement(opened.run, known, data)}")


COLUMNS = {"one": "one program", "majority": "majority", "question": "one question"}


def clarify_view(data: Mapping[str, Any], title: str, candidates: int) -> RenderableType:
    """Return a table of pass@1 by prompt: one program, the most common behaviour, a person's choice."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    from roboeval.evaluation.clarify import DRAWS_PER_PROMPT

    table = Table(title=f"{title}, {candidates} candidates", title_justify="left")
    table.add_column("task")
    for name in ("prompt", *COLUMNS.values(), "asked", "mattered"):
        table.add_column(name, justify="right")
    for one in data["prompts"]:
        table.add_row(one["task"], str(one["prompt"]), *_cells(one))
    table.add_section()
    table.add_row("all", "", *_cells(data), style="bold")
    lines = [
        "pass@1 of one program, of the largest group with one behaviour, and of a simulated person's choice",
        f"means over {DRAWS_PER_PROMPT} random draws of candidates; the check rejects some, even right ones",
        "asked: share of the draws in which the programs that are left differed enough for a question",
        "mattered: share of the questions whose answer led to another verdict than the largest group's",
    ]
    if data["tokens"] is not None:
        lines.append(f"{data['tokens']:,.0f} tokens for {candidates} candidates, on average")
    return Group(table, *(Text(line, "dim") for line in lines))


def _cells(of: Mapping[str, Any]) -> list[str]:
    from roboeval.analysis.metrics import percent

    mattered = "-" if of["mattered"] is None else f"{percent(of['mattered'])} %"
    return [*(f"{of[name]:.3f}" for name in COLUMNS), f"{percent(of['asked'])} %", mattered]
