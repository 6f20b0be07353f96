"""The command that says what rejection sampling would have given."""

from __future__ import annotations

from typing import Annotated

import typer

from roboeval.commands.options import (
    JsonOption,
    RunArgument,
    SuiteOption,
    command,
    cores,
    load,
    open_evaluation,
    options_of,
)
from roboeval.terminal import note, print_json, print_rich, watched


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
    workers: Annotated[
        int | None, typer.Option(min=1, help="Programs that run at the same time; all cores by default.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """What asking again for programs that a check rejects would have given, from a judged run."""
    from codebotler.badinput import BadInput
    from roboeval.checks import Checks
    from roboeval.resampling import LIMITS, Trial, by_prompt, curve_data, ran, render
    from roboeval.run import Run
    from roboeval.tables import key_of

    judged_by = load(suite)
    evaluation = open_evaluation(run, judged_by, suite, ablated=False)
    rows = watched(evaluation.rows(), "reading", evaluation.scope.total)
    ended = {key_of(row): (ran(row), bool(row["passed"])) for row in rows}
    again = command("evaluate", run, *options_of(evaluation, judged_by), suite=suite)
    if (complaint := evaluation.complaint()) is not None:
        raise BadInput(f"{complaint}; `{again} --redo` judges what stands there")
    if not ended:
        raise BadInput(f"no completion has been judged; `{again}` goes on", file=run)
    if (unfinished := evaluation.unfinished()) is not None:
        note(f"{unfinished}, and only these count; `{again}` goes on")
    programs = {c.key: (c.task, c.program_sha256) for c in evaluation.judged() if c.key in ended}
    checks = Checks(Run(run), judged_by, samples=samples, seed=seed)
    checked = checks.add((c for c in evaluation.judged() if c.key in ended), workers=workers or cores())
    for _ in watched(checked, "checking", len(set(programs.values()))):
        pass
    prompts = by_prompt(
        (key, Trial(not checks.problems[programs[key]], *outcome)) for key, outcome in ended.items()
    )
    limits = sorted(set(retries)) if retries else LIMITS
    if json:
        print_json({"suite": judged_by.name, "samples": samples, "seed": seed, **curve_data(prompts, limits)})
    else:
        print_rich(render(prompts, limits, title=str(run)))
