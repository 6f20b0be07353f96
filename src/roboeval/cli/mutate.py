"""The command that makes right programs wrong, and says which of them the checks of a suite let through."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict

import typer

from roboeval.cli.options import SuiteOption, WorkersOption, cores, load, named, task_names
from roboeval.cli.output import note, print_rich, watched

if TYPE_CHECKING:
    from codebotler.simulator.engine import Lanes
    from roboeval.mutation.mutants import Original
    from roboeval.mutation.scores import Job, Score
    from roboeval.suites.load import Suite, Task


def mutate(
    tasks: Annotated[
        list[str] | None,
        typer.Argument(
            help="Tasks of the suite; all by default.", metavar="TASK...", autocompletion=task_names
        ),
    ] = None,
    suite: SuiteOption = "paper",
    also: Annotated[
        list[str] | None,
        typer.Option(
            help="Mutate the right ones of these programs, too: a run, or anything else that "
            "`roboeval evaluate` reads; may be given several times."
        ),
    ] = None,
    worlds: Annotated[
        int | None,
        typer.Option(min=1, max=10_000, help="Try them in so many generated worlds, if the suite makes any."),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="From which mutants are drawn, and worlds are generated.")
    ] = 1,
    most: Annotated[
        int, typer.Option("--mutants", min=1, help="Try at most so many of each task, drawn evenly.")
    ] = 400,
    out: Annotated[
        Path | None,
        typer.Option(help="Keep scores, mutants and survivors in this folder.", parser=named("a folder")),
    ] = None,
    brief: Annotated[bool, typer.Option("--brief", help="Only the tables, without the survivors.")] = False,
    at_least: Annotated[
        float | None, typer.Option(min=0, max=1, help="Status 1 if a task scores less than this.")
    ] = None,
    workers: WorkersOption = None,
) -> None:
    """Say which wrong programs the checks of a suite let through.

    Right programs are made wrong, as models do, and judged.
    """
    from codebotler.simulator.engine import Lanes
    from roboeval.mutation.keeping import keep

    known = load(suite)
    # As other commands take them after --tasks, too.
    names = [name for word in tasks or known.tasks for name in word.split(",")]
    wanted = [known.task(name) for name in dict.fromkeys(names)]
    further = named_programs(also or [], known)
    how = How(worlds=worlds, most=most, seed=seed)
    jobs = [job_of(known, task, further.get(task.name, ()), **how) for task in wanted]
    with Lanes(workers or cores()) as lanes:
        scores = [score_of(job, lanes) for job in jobs]
    show_scores(scores, known.name, brief=brief)
    if out is not None:
        keep(scores, out)
        note(f"scores, mutants and survivors are in {out}")
    if at_least is not None and any(score.score is None or score.score < at_least for score in scores):
        raise SystemExit(1)


class How(TypedDict):
    """In how many worlds, and how many mutants of a task are tried, drawn from which seed."""

    worlds: int | None
    most: int
    seed: int


def job_of(
    suite: Suite, task: Task, further: Sequence[Original], *, worlds: int | None, most: int, seed: int
) -> Job:
    """What is to be done for a task."""
    from roboeval.mutation.mutants import originals
    from roboeval.mutation.scores import Job
    from roboeval.mutation.worlds import worlds_of
    from roboeval.suites.solutions import equivalent_mutants

    return Job(
        task=task.name,
        phrasings=task.prompts,
        programs=originals(task, further),
        scenarios=worlds_of(suite, task, worlds, seed),
        rules=suite.rules,
        still_right=equivalent_mutants(task),
        most=most,
        seed=seed,
    )


def named_programs(sources: Sequence[str], suite: Suite) -> Mapping[str, list[Original]]:
    """The programs that a user names, by their task; the same one may be among them several times."""
    from roboeval.evaluation.completions import name_of
    from roboeval.evaluation.run import open_source
    from roboeval.mutation.mutants import Original

    found: dict[str, list[Original]] = {}
    for source in sources:
        for completion in open_source(source, suite).completions:
            name = f"{source}:{name_of(completion.key)}"
            found.setdefault(completion.task, []).append(Original(name, completion.program, claimed=False))
    return found


def score_of(job: Job, lanes: Lanes) -> Score:
    """Run the originals of a task, make mutants of the right ones, and try these."""
    from roboeval.mutation.mutants import drawn, mutants
    from roboeval.mutation.operator import Setting
    from roboeval.mutation.scores import Score, Trial, explained
    from roboeval.mutation.survival import baselines, ends

    running = baselines(job.programs, job.scenarios, job.rules, lanes)
    before = list(watched(running, f"running {job.task}", len(job.programs)))
    right = [baseline for baseline in before if baseline.fault is None]
    setting = Setting.of([scenario.world for scenario in job.scenarios], job.phrasings)
    made = drawn(mutants([baseline.original for baseline in right], setting), job.most, job.seed)
    trying = ends(made, right, job.scenarios, job.rules, lanes)
    found = list(watched(trying, f"mutating {job.task}", len(made)))
    trials = [Trial(mutant, end) for mutant, end in zip(made, found, strict=True)]
    return Score(
        task=job.task,
        worlds=len(job.scenarios),
        right=tuple(baseline.original for baseline in right),
        wrong=tuple(baseline for baseline in before if baseline.fault is not None),
        trials=explained(trials, job.still_right),
    )


def show_scores(scores: Sequence[Score], suite: str, *, brief: bool) -> None:
    """Print the tables, the survivors, and beside them what makes a score doubtful."""
    from rich.console import Group
    from rich.text import Text

    from roboeval.mutation.view import operators_view, scores_view, survivors_view

    parts = [scores_view(scores, suite), Text(), operators_view(scores)]
    print_rich(Group(*parts, *([] if brief else map(survivors_view, scores))))
    for score in scores:
        for complaint in score.complaints:
            note(f"warning: {complaint}")
        for baseline in score.wrong:
            if baseline.fault is not None and baseline.original.claimed:
                where, why = baseline.fault.world, baseline.fault.why
                note(
                    f"not right, and so not mutated: {score.task}, {baseline.original.name} ({where}: {why})"
                )
