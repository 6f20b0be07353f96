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
    from roboeval.resampling import LIMITS, by_prompt, curve_data, render
    from roboeval.run import Run

    judged_by = load(suite)
    evaluation = open_evaluation(run, judged_by, suite, ablated=False)
    rows = list(watched(evaluation.rows(), "reading", evaluation.scope.total))
    again = command("evaluate", run, *options_of(evaluation, judged_by), suite=suite)
    if (complaint := evaluation.complaint()) is not None:
        raise BadInput(f"{complaint}; `{again} --redo` judges what stands there")
    if not rows:
        raise BadInput(f"no completion has been judged; `{again}` goes on", file=run)
    if (unfinished := evaluation.unfinished()) is not None:
        note(f"{unfinished}, and only these count; `{again}` goes on")
    programs = {c.key: (c.task, c.program_sha256) for c in evaluation.judged()}
    checks = Checks(Run(run), judged_by, samples=samples, seed=seed)
    wanted = (c for c in evaluation.judged() if evaluation.scope.selects(c.task))
    for _ in watched(checks.add(wanted, workers=workers or cores()), "checking", len(set(programs.values()))):
        pass
    accepted = [not checks.problems[programs[row["task"], row["prompt"], row["index"]]] for row in rows]
    prompts = by_prompt(rows, accepted)
    limits = sorted(set(retries)) if retries else LIMITS
    if json:
        print_json({"suite": judged_by.name, "samples": samples, "seed": seed, **curve_data(prompts, limits)})
    else:
        print_rich(render(prompts, limits, title=str(run)))
