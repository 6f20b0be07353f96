"""Runs further rounds of `roboeval run`, which regenerate rejected programs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from roboeval.cli.engine_choice import engine_named
from roboeval.cli.output import note, show_progress

if TYPE_CHECKING:
    from roboeval.evaluation.engines.engine import OpenEngine
    from roboeval.evaluation.generating.requests import GenerationPlan
    from roboeval.evaluation.runs.completions import Completion, CompletionKey
    from roboeval.evaluation.runs.folder import RunFolder


def further_rounds(
    run: RunFolder,
    plan: GenerationPlan,
    most: int,
    *,
    repairs: bool,
    workers: int | None,
    require_isolation: bool,
    complete: Callable[[RunFolder, GenerationPlan], Path],
) -> Iterator[Path]:
    """Regenerate or repair rejected programs in up to `most` rounds, and yield the folder of each round.

    There are no more rounds once the check accepts all programs.
    """
    from roboeval.evaluation.generating.requests import RoundPlan
    from roboeval.evaluation.runs.completions import how_many

    planned, latest = {*plan.keys()}, run
    for number in range(1, most + 1):
        completions = {one.key: one for one in latest.read(plan.suite) if one.key in planned}
        with engine_named("local", workers, require_isolation=require_isolation) as engine_for:
            problems = _rejected(latest, plan, completions, engine_for(0))
        if not problems:
            return
        note(f"round {number}: the check rejects {how_many(len(problems))} of {len(planned):,}")
        following = RoundPlan(
            plan.suite,
            plan.tasks,
            plan.num_completions,
            number=number,
            repairs=repairs,
            earlier=completions,
            problems=problems,
        )
        latest = following.folder(run)
        yield complete(latest, following)


def _rejected(
    run: RunFolder, plan: GenerationPlan, completions: dict[CompletionKey, Completion], engine: OpenEngine
) -> dict[CompletionKey, list[str]]:
    """Check the programs of a run, and return the problems of those that the check rejects."""
    from roboeval.evaluation.generating.checks import check_programs

    programs = {(one.task, one.program_sha256) for one in completions.values()}
    checking = check_programs(run, plan.suite, completions.values(), engine, samples=5, seed=0)
    problems = dict(show_progress(checking, "checking", len(programs)))
    found = {key: problems[one.task, one.program_sha256] for key, one in completions.items()}
    return {key: listed for key, listed in found.items() if listed}
