"""The command that says what rejection sampling would have given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from roboeval.cli.options import (
    EngineOption,
    JsonOption,
    RunArgument,
    SuiteOption,
    WorkersOption,
    as_judged,
    engine_named,
    expect_current,
    load,
    open_evaluation,
)
from roboeval.cli.output import print_json, print_rich, watched

if TYPE_CHECKING:
    from roboeval.analysis.resample import Prompt
    from roboeval.evaluation.completions import Key
    from roboeval.evaluation.engines import OpenEngine
    from roboeval.evaluation.evaluation import Evaluation
    from roboeval.suites.load import Suite


def resample(
    run: RunArgument,
    retries: Annotated[
        list[int] | None, typer.Option(min=0, help="A limit of retries; may be given several times.")
    ] = None,
    samples: Annotated[
        int, typer.Option(min=1, max=10_000, help="Worlds that are imagined to check a program.")
    ] = 5,
    seed: Annotated[int, typer.Option(help="From which they are drawn.")] = 0,
    suite: SuiteOption = "paper",
    workers: WorkersOption = None,
    engine: EngineOption = "local",
    json: JsonOption = False,
) -> None:
    """Say what checking programs before a run would have saved.

    From a judged run: what asking again for those that a check rejects would have given.
    """
    from roboeval.analysis.resample import LIMITS, curve_data, ran, render
    from roboeval.evaluation.tables import key_of

    checker = engine_named(engine, workers)
    judged_by = as_judged(run, load(suite), ablated=False)
    evaluation = open_evaluation(run, judged_by, suite, ablated=False)
    rows = watched(evaluation.rows(), "reading", evaluation.scope.total)
    ended = {key_of(row): (ran(row), bool(row["passed"])) for row in rows}
    expect_current(evaluation, judged_by, suite)
    prompts = checked(evaluation, judged_by, ended, samples=samples, seed=seed, engine=checker)
    limits = sorted(set(retries)) if retries else LIMITS
    if json:
        print_json({"suite": judged_by.name, "samples": samples, "seed": seed, **curve_data(prompts, limits)})
    else:
        print_rich(render(prompts, limits, title=str(run)))


def checked(
    evaluation: Evaluation,
    suite: Suite,
    ended: Mapping[Key, tuple[bool, bool]],
    *,
    samples: int = 5,
    seed: int = 0,
    engine: OpenEngine,
) -> tuple[Prompt, ...]:
    """The completions of a run by prompt, as the check sees them; what it said stays in the run.

    Args:
        evaluation: that lies in the run.
        suite: by which it was judged.
        ended: which completions, and of each whether it ran without an error and whether it passed.
        samples: how many worlds to imagine for each program.
        seed: from which they are drawn.
        engine: where programs are checked.
    """
    from roboeval.analysis.resample import Trial, by_prompt
    from roboeval.evaluation.checks import check_programs

    programs = {c.key: (c.task, c.program_sha256) for c in evaluation.judged() if c.key in ended}
    completions = (c for c in evaluation.judged() if c.key in ended)
    checking = check_programs(evaluation.run, suite, completions, engine, samples=samples, seed=seed)
    problems = dict(watched(checking, "checking", len(set(programs.values()))))
    return by_prompt((key, Trial(not problems[programs[key]], *outcome)) for key, outcome in ended.items())
