"""Defines the commands compare, for two runs or suites, and resample, for rejection sampling."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roboeval.cli.engine_choice import engine_named
from roboeval.cli.inputs import expect_same_suite, open_with_results
from roboeval.cli.options import (
    AblationOption,
    EngineOption,
    HouseRulesOption,
    JsonOption,
    ProcessOption,
    RunArgument,
    SuiteOption,
    WorkersOption,
    path_to,
)
from roboeval.cli.output import fail, note, print_json, print_rich, show_progress

if TYPE_CHECKING:
    import polars as pl

    from roboeval.evaluation.engines.engine import OpenEngine
    from roboeval.evaluation.runs.completions import Completion
    from roboeval.evaluation.runs.folder import RunFolder
    from roboeval.evaluation.runs.results import Results
    from roboeval.suites.load import Suite


def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(help="Two judged runs, or at least one with --suites.", parser=path_to("a run")),
    ],
    suite: SuiteOption = "paper",
    suites: Annotated[
        str | None,
        typer.Option(help="Two suites, such as paper,plus; shows which verdicts the second changes."),
    ] = None,
    most: Annotated[
        int, typer.Option("--groups", min=0, help="Number of groups of programs to show with --suites.")
    ] = 10,
    ablation: AblationOption = False,
    json: JsonOption = False,
) -> None:
    """Show how much better the second run is, and how certain that is.

    The difference is the second run's pass rate minus the first's.
    """
    if suites is not None:
        compare_suites(runs, suites, most=most, ablated=ablation, as_json=json)
    elif len(runs) == _PAIR:
        compare_runs(runs, suite, ablated=ablation, as_json=json)
    else:
        fail(f"name two runs, not {len(runs)}; another number of runs is only possible with --suites")


_PAIR = 2


def compare_runs(paths: Sequence[Path], suite: str, *, ablated: bool, as_json: bool) -> None:
    """Print how much better the second of two runs is, as tables or as JSON."""
    from roboeval.analysis.comparisons.compare import (
        comparable_tables,
        compare_tables,
        comparison_data,
        failure_shares,
        other_differences,
    )
    from roboeval.cli.views.comparison import comparison_view

    opened = [open_with_results(path, suite, ablated=ablated) for path in paths]
    expect_same_suite(opened, suite)
    tables = comparable_tables(*(one.table for one in opened))
    result = compare_tables(*(one.table for one in opened))
    warnings = other_differences(*opened)
    for warning in warnings:
        note(f"warning: {warning}")
    names, failing = (str(paths[0]), str(paths[1])), [failure_shares(table) for table in tables]
    if as_json:
        data = comparison_data(result, names)
        for side, one, shares in zip(("first", "second"), opened, failing, strict=True):
            data[side] |= {**asdict(one.coverage), "cut_off": one.scope.cut_off, "failures": shares}
        print_json({**data, "warnings": warnings})
    else:
        print_rich(comparison_view(result, names, opened, failing))


def compare_suites(paths: Sequence[Path], suites: str, *, most: int, ablated: bool, as_json: bool) -> None:
    """Print how verdicts change between two suites, such as `paper,plus`. List at most `most` groups."""
    from roboeval.analysis.comparisons.verdict_changes import changes_data, verdict_changes
    from roboeval.cli.views.comparison import changes_view
    from roboeval.evaluation.runs.completions import how_many

    if len({path.resolve() for path in paths}) < len(paths):
        fail("a run is listed twice; list each run once")
    names = [name.strip() for name in suites.split(",")]
    if len(names) != _PAIR or len({*names}) != _PAIR or not all(names):
        fail(f'--suites takes two suites separated by a comma, such as paper,plus, not "{suites}"')
    found = []
    for path in paths:
        first = open_with_results(path, names[0], ablated=ablated)
        second = open_with_results(path, names[1], ablated=ablated, reuse_from=first)
        found.append(verdict_changes(str(path), first, second))
    for one in found:
        if one.left_out:
            note(f"{one.name}: left out because only one suite has judged them: {how_many(one.left_out)}")
    if as_json:
        print_json(changes_data(found))
    else:
        print_rich(changes_view(found, most=most))


def resample(
    run: RunArgument,
    retries: Annotated[
        list[int] | None, typer.Option(min=0, help="Maximum number of retries; may be given several times.")
    ] = None,
    suite: SuiteOption = "paper",
    workers: WorkersOption = None,
    engine: EngineOption = "local",
    one_process_per_run: ProcessOption = False,
    rules: HouseRulesOption = None,
    json: JsonOption = False,
) -> None:
    """Compute how often programs would pass with rejection sampling.

    With rejection sampling, a model is asked again if the check rejects its program. The rate is computed
    from a judged run's completions, for each maximum number of retries; no model is asked.
    """
    from roboeval.analysis.comparisons.compare import has_missions
    from roboeval.analysis.resample import LIMITS, count_by_prompt, curve_data
    from roboeval.cli.views.groups import resample_view

    with engine_named(engine, workers, one_process_per_run=one_process_per_run) as engine_for:
        results = open_with_results(run, suite, ablated=False, rules=rules)
        if has_missions(results.table):
            fail(f"{run}: contains missions of an agent, which cannot be checked; name a run of programs")
        checker = engine_for(len(results.places))
        prompts = count_by_prompt(check_run(results, checker))
    coverage = results.coverage
    limits = sorted(set(retries)) if retries else LIMITS
    if json:
        of = {"suite": results.manifest["suite"], **asdict(coverage)}
        print_json({**of, **curve_data(prompts, limits)})
    else:
        print_rich(resample_view(prompts, limits, title=str(run), coverage=coverage))


def check_run(results: Results, engine: OpenEngine) -> pl.DataFrame:
    """Check a run's programs and save the results. Return the run's table with the column `accepted`."""
    from roboeval.evaluation.runs.table import with_answers

    completions = [results.completions[key] for key in results.places]
    judged = [one for one in completions if one.mission is None]  # an agent's mission holds in one world only
    problems = check_completions(results.run, results.required_suite, judged, engine)
    return with_answers(results.table, problems)


def check_completions(
    run: RunFolder, suite: Suite, completions: Collection[Completion], engine: OpenEngine
) -> dict[tuple[str, str], list[str]]:
    """Check programs and save the results in the run. Return the problems by task and program hash."""
    from roboeval.evaluation.generating.checks import check_programs

    different = {(one.task, one.program_sha256) for one in completions}
    checking = check_programs(run, suite, completions, engine)
    return dict(show_progress(checking, "checking", len(different)))
