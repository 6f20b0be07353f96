"""Runs further rounds of `roboeval run`, which regenerate rejected programs and judge all programs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from codebotler.core.terminal import print_rich
from roboeval.cli.output import show_progress

if TYPE_CHECKING:
    from roboeval.cli.views.rounds import Round
    from roboeval.evaluation.engines import OpenEngine
    from roboeval.evaluation.requests import GenerationPlan
    from roboeval.evaluation.runs.completions import Completion, CompletionKey
    from roboeval.evaluation.runs.folder import RunFolder


def further_rounds(
    run: RunFolder,
    plan: GenerationPlan,
    most: int,
    *,
    repairs: bool,
    engine: Callable[[], OpenEngine],
    complete: Callable[[RunFolder, GenerationPlan], Path],
) -> list[Path]:
    """Regenerate or repair rejected programs in up to `most` rounds, and print the results of each round.

    Returns the folders of the rounds. There are no more rounds once the check accepts all programs.
    """
    from roboeval.cli.views.rounds import rounds_view
    from roboeval.evaluation.rounds import RoundPlan

    found: list[Round] = []
    runs = [run]
    while True:
        planned = {*plan.keys()}
        completions = {one.key: one for one in runs[-1].read(plan.suite) if one.key in planned}
        problems = dict(_rejected(runs[-1], plan, completions, engine()))
        found.append(_round(runs[-1], plan, completions, problems, len(found), engine()))
        if not problems or len(found) > most:
            break
        following = RoundPlan(
            plan.suite,
            plan.tasks,
            plan.num_completions,
            number=len(found),
            repairs=repairs,
            earlier=completions,
            problems=problems,
        )
        complete(following.folder(run), following)
        runs.append(following.folder(run))
    print_rich(rounds_view(found, repairs=repairs))
    return [one.path for one in runs[1:]]


def _rejected(
    run: RunFolder, plan: GenerationPlan, completions: dict[CompletionKey, Completion], engine: OpenEngine
) -> Iterator[tuple[CompletionKey, list[str]]]:
    from roboeval.evaluation.checks import check_programs

    programs = {(one.task, one.program_sha256) for one in completions.values()}
    checking = check_programs(run, plan.suite, completions.values(), engine, samples=5, seed=0)
    problems = dict(show_progress(checking, "checking", len(programs)))
    for key, one in completions.items():
        if listed := problems[one.task, one.program_sha256]:
            yield key, listed


def _round(
    run: RunFolder,
    plan: GenerationPlan,
    completions: dict[CompletionKey, Completion],
    problems: dict[CompletionKey, list[str]],
    number: int,
    engine: OpenEngine,
) -> Round:
    from roboeval.analysis.summary import summarise
    from roboeval.analysis.tally import Tally
    from roboeval.cli.views.rounds import Round
    from roboeval.evaluation.evaluate import evaluate_run
    from roboeval.evaluation.requests import add_usage, no_usage
    from roboeval.evaluation.rounds import round_of
    from roboeval.evaluation.runs.rows import key_of
    from roboeval.evaluation.runs.scope import JudgingScope

    rows = evaluate_run(run, plan.suite, ablated=False, tasks=plan.tasks, redo=False, engine=engine)
    tally, usage = Tally(), no_usage()
    for row in show_progress(rows, "judging", len(completions)):
        if key_of(row) in completions:
            tally.add(row)
    requested = [one for one in completions.values() if round_of(one) == number]
    for one in requested:
        add_usage(usage, one.more.get("usage"))
    counted = summarise(tally, plan.suite, JudgingScope.of(completions.values(), plan.tasks))
    return Round(number, counted, len(requested), len(completions) - len(problems), usage.total())
