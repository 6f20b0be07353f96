"""Commands about several runs at once: report, compare."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict

import typer

from roboeval.commands.options import (
    AblationOption,
    JsonOption,
    SuiteOption,
    command,
    cores,
    expect_current,
    load,
    named,
    open_evaluation,
    options_of,
)
from roboeval.commands.resampling import checked
from roboeval.terminal import note, print_json, print_rich, watched

if TYPE_CHECKING:
    from roboeval.evaluation import Evaluation
    from roboeval.records import Key
    from roboeval.report.reading import JudgedRun
    from roboeval.suite import Suite


def report(
    runs: Annotated[list[Path], typer.Argument(help="Runs that were judged.", parser=named("a run"))],
    out: Annotated[Path, typer.Option(help="The folder to write to.", parser=named("a folder"))],
    suite: SuiteOption = "paper",
    published: Annotated[
        bool, typer.Option("--published", help="Set the paper's causes of failures beside ours.")
    ] = False,
    price: Annotated[
        list[str] | None,
        typer.Option(help="MODEL=INPUT/OUTPUT, of a million tokens each; may be given several times."),
    ] = None,
    check: Annotated[
        bool, typer.Option(help="Check programs that were not checked, for rejection sampling.")
    ] = True,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Programs that run at the same time; all cores by default.")
    ] = None,
) -> None:
    """Draw the figures of the paper, and one page about how models do, why, and how sure that is."""
    from codebotler.terminal import busy
    from roboeval.report.contents import Wishes, headline, sections
    from roboeval.report.cost import expect_known, price_from
    from roboeval.report.reading import named_apart
    from roboeval.report.writing import pieces, write_report

    prices = tuple(map(price_from, price or ()))
    known = load(suite)
    evaluations = [open_evaluation(run, known, suite, ablated=False) for run in runs]
    expect_alike(runs, evaluations, known, suite)
    how = How(check=check, workers=workers or cores())
    read = named_apart([judged_run(one, known, suite, **how) for one in evaluations])
    expect_known(prices, read)
    words = [
        *map(str, runs),
        "--out",
        out,
        *(["--published"] * published),
        *([] if check else ["--no-check"]),
    ]
    words += [word for text in price or () for word in ("--price", text)]
    wishes = Wishes(published, prices, command("report", *words, suite=suite))
    with busy("putting together"):
        parts = sections(read, known, wishes)
    written = write_report(*headline(read, known), parts, out)
    for _ in watched(written, "writing", pieces(parts)):
        pass
    note(f"the report is in {out / 'index.html'}")


def compare(
    first: Annotated[Path, typer.Argument(help="A run that was judged.", parser=named("a run"))],
    second: Annotated[Path, typer.Argument(help="Another one.", parser=named("a run"))],
    suite: SuiteOption = "paper",
    ablation: AblationOption = False,
    json: JsonOption = False,
) -> None:
    """Say by how much the second run passes more often than the first, and how sure that is."""
    from roboeval.comparison import compared, comparison_data, prompts, render, told_of, unlike
    from roboeval.metrics import score_by_prompt
    from roboeval.run import load_head

    known = load(suite)
    paths = first, second
    evaluations = [open_evaluation(path, known, suite, ablated=ablation) for path in paths]
    expect_alike(paths, evaluations, known, suite)
    scores, abouts = [], []
    for evaluation in evaluations:
        rows = watched(evaluation.rows(), "reading", evaluation.scope.total)
        tasks = score_by_prompt((row["task"], row["prompt"], row["passed"]) for row in rows)
        expect_current(evaluation, known, suite)
        scores.append({(p.task, p.prompt): p.pass_at(1) for task in tasks for p in task.prompts})
        about = load_head(evaluation.run.about) if evaluation.run.about.exists() else {}
        abouts.append(told_of(about, evaluation.head))
    result = compared(*scores)
    for difference in unlike(*abouts):
        note(f"warning: {difference}")
    if result.left_out:
        note(f"left out, since only one of them has them: {prompts(result.left_out)}")
    names = str(first), str(second)
    if json:
        print_json({**comparison_data(result, names), "warnings": unlike(*abouts)})
    else:
        print_rich(render(result, names))


def expect_alike(
    paths: Sequence[Path], evaluations: Sequence[Evaluation], suite: Suite, suite_name: str
) -> None:
    """Refuse runs that were judged by suites of different content."""
    from roboeval.comparison import expect_same_suite

    heads, again = {}, {}
    for path, one in zip(paths, evaluations, strict=True):
        heads[str(path)] = one.head
        ablated = bool(one.head.get("ablation"))
        again[str(path)] = command(
            "evaluate", path, *options_of(one, suite), suite=suite_name, ablated=ablated
        )
    expect_same_suite(heads, suite, again)


class How(TypedDict):
    """Whether programs are checked, and how many at the same time."""

    check: bool
    workers: int


def judged_run(
    evaluation: Evaluation, suite: Suite, suite_name: str, *, check: bool, workers: int
) -> JudgedRun:
    """A run with its verdicts, those of the ablation, and what the check says of its programs."""
    from dataclasses import replace

    from roboeval.report.reading import read_run, scored
    from roboeval.resampling import ran
    from roboeval.run import evaluation_key
    from roboeval.tables import key_of

    ended: dict[Key, tuple[bool, bool]] = {}

    def noted(rows: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
        for row in rows:
            ended[key_of(row)] = ran(row), bool(row["passed"])
            yield row

    run = read_run(evaluation, noted(watched(evaluation.rows(), "reading", evaluation.scope.total)), suite)
    expect_current(evaluation, suite, suite_name)
    folder = evaluation.run
    if folder.rows(evaluation_key(suite, ablated=True)).is_file():
        alone = open_evaluation(folder.path, suite, suite_name, ablated=True)
        run = replace(run, ablated=scored(watched(alone.rows(), "reading", alone.scope.total), suite))
        expect_current(alone, suite, suite_name)
    return replace(run, trials=checked(evaluation, suite, ended, workers=workers)) if check else run
