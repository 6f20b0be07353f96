"""Defines the command mutate, which tests a suite by mutation."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roboeval.cli.inputs import load_suite_option
from roboeval.cli.options import ProcessOption, SuiteOption, WorkersOption, WorldsOption, path_to
from roboeval.cli.output import note, print_rich, show_progress

if TYPE_CHECKING:
    from roboeval.mutation.mutants import Original
    from roboeval.mutation.score import MutationScore
    from roboeval.suites.load import Suite


def mutate(
    tasks: Annotated[
        list[str] | None, typer.Argument(help="Tasks of the suite; all by default.", metavar="TASK...")
    ] = None,
    suite: SuiteOption = "paper",
    also: Annotated[
        list[str] | None,
        typer.Option(
            help="Also mutate the correct programs in this run, or in another source that "
            "`roboeval evaluate` reads; may be given several times."
        ),
    ] = None,
    worlds: WorldsOption = None,
    seed: Annotated[int, typer.Option(min=0, help="Random seed for mutants and worlds.")] = 1,
    most: Annotated[
        int,
        typer.Option(
            "--mutants", min=1, help="Maximum number of mutants per task, sampled evenly from all operators."
        ),
    ] = 400,
    out: Annotated[
        Path | None,
        typer.Option(help="Save scores, mutants and survivors in this folder.", parser=path_to("a folder")),
    ] = None,
    brief: Annotated[bool, typer.Option("--brief", help="Print only the table, not the survivors.")] = False,
    at_least: Annotated[
        float | None, typer.Option(min=0, max=1, help="Exit with status 1 if a task scores less than this.")
    ] = None,
    workers: WorkersOption = None,
    one_process_per_run: ProcessOption = False,
) -> None:
    """Measure which incorrect programs survive a suite's checks.

    The incorrect programs are mutants: correct programs with mistakes that models typically make.
    """
    from codebotler.simulator.pool import WorkerPool, cores
    from roboeval.mutation.report import write_scores
    from roboeval.mutation.trials import mutation_score

    known = load_suite_option(suite)
    wanted = [known.task(name) for name in tasks or known.tasks]
    further = named_programs(also or [], known)
    score = partial(mutation_score, worlds=worlds, most=most, seed=seed, progress=show_progress)
    with WorkerPool(workers or cores(), one_process_per_run=one_process_per_run) as pool:
        scores = [score(task, known, pool, further=further.get(task.name, ())) for task in wanted]
    show_scores(scores, known.name, brief=brief)
    if out is not None:
        write_scores(scores, out)
        note(f"the scores, mutants and survivors are in {out}")
    if at_least is not None and any(score.score is None or score.score < at_least for score in scores):
        raise SystemExit(1)


def named_programs(sources: Sequence[str], suite: Suite) -> Mapping[str, list[Original]]:
    """Read programs from runs or other sources. Return them by task, named like `my-run:LunchTime/0/12`."""
    from roboeval.evaluation.runs.completions import name_of
    from roboeval.evaluation.runs.source import open_source
    from roboeval.mutation.mutants import Original

    found: defaultdict[str, list[Original]] = defaultdict(list)
    for source in sources:
        for completion in open_source(source, suite).completions:
            name = f"{source}:{name_of(completion.key)}"
            found[completion.task].append(Original(name, completion.program, declared_right=False))
    return found


def show_scores(scores: Sequence[MutationScore], suite: str, *, brief: bool) -> None:
    """Print the table of scores, the mutants that survived (unless `brief`), and any warnings."""
    from rich.console import Group

    from roboeval.mutation.report import scores_view, survivors_view

    print_rich(Group(scores_view(scores, suite), *([] if brief else map(survivors_view, scores))))
    for score in scores:
        for warning in score.warnings:
            note(f"warning: {warning}")
        for original, fault in score.wrong:
            if original.declared_right:
                where = f"{fault.world}: {fault.why}"
                note(f"not mutated because the program is wrong: {score.task}, {original.name} ({where})")
