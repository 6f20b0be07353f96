"""Commands about several runs at once: report, compare."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict

import typer

from roboeval.cli.options import (
    AblationOption,
    JsonOption,
    SuiteOption,
    WorkersOption,
    as_judged,
    command,
    command_anywhere,
    cores,
    expect_current,
    load,
    named,
    open_evaluation,
    options_of,
)
from roboeval.cli.output import fail, note, print_json, print_rich, watched
from roboeval.cli.resample import checked

if TYPE_CHECKING:
    from roboeval.analysis.verdict_changes import Judged
    from roboeval.evaluation.completions import Key, Row
    from roboeval.evaluation.evaluation import Evaluation
    from roboeval.report.reading import JudgedRun
    from roboeval.suites.load import Suite


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
    beside: Annotated[
        str | None, typer.Option(help="Another suite that judged the runs: what its checks change.")
    ] = None,
    check: Annotated[
        bool, typer.Option(help="Check programs that were not checked, for rejection sampling.")
    ] = True,
    workers: WorkersOption = None,
) -> None:
    """Draw the paper's figures, and one page about how models do.

    The page also says why, and how sure that is.
    """
    from dataclasses import replace

    from codebotler.terminal import busy
    from roboeval.report.contents import Wishes, headline, sections
    from roboeval.report.cost import expect_known, price_from
    from roboeval.report.reading import named_apart
    from roboeval.report.writing import expect_no_others, pieces, write_report

    expect_no_others(out)
    prices = tuple(map(price_from, price or ()))
    known = as_judged(runs[0], load(suite), ablated=False)
    evaluations = [open_evaluation(run, known, suite, ablated=False) for run in runs]
    expect_alike(runs, evaluations, known, suite)
    how = How(check=check, workers=workers or cores())
    read = named_apart([judged_run(one, known, suite, **how) for one in evaluations])
    if beside is not None:
        if beside == suite:
            fail(f'--beside takes another suite than "{suite}", by which the report judges')
        read = [
            replace(one, beside=judged_by(run, beside, ablated=False)[1])
            for one, run in zip(read, runs, strict=True)
        ]
    expect_known(prices, read)
    words = [
        *map(str, runs),
        "--out",
        out,
        *(["--published"] * published),
        *([] if beside is None else ["--beside", beside]),
        *([] if check else ["--no-check"]),
    ]
    words += [word for text in price or () for word in ("--price", text)]
    wishes = Wishes(published, prices, command_anywhere("report", *words, suite=suite))
    with busy("putting together"):
        parts = sections(read, known, wishes)
    written = write_report(*headline(read, known), parts, out)
    for _ in watched(written, "writing", pieces(parts)):
        pass
    note(f"the report is in {out / 'index.html'}")


def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(help="Two runs that were judged; with --suites, one or more.", parser=named("a run")),
    ],
    suite: SuiteOption = "paper",
    suites: Annotated[
        str | None,
        typer.Option(help="Two suites, such as paper,plus: what the second changes, of each run."),
    ] = None,
    most: Annotated[
        int, typer.Option("--groups", min=0, help="With --suites: how many groups of programs to show.")
    ] = 10,
    ablation: AblationOption = False,
    json: JsonOption = False,
) -> None:
    """Say by how much one run is better, and how sure that is.

    That is: by how much the second run passes more often than the first.
    """
    if suites is not None:
        compare_suites(runs, suites, most=most, ablated=ablation, as_json=json)
    elif len(runs) == PAIR:
        compare_runs(runs, suite, ablated=ablation, as_json=json)
    else:
        fail(
            f"a comparison takes two runs, and {len(runs)} {'is' if len(runs) == 1 else 'are'} named; "
            "with --suites it takes any number"
        )


PAIR = 2


def compare_runs(paths: Sequence[Path], suite: str, *, ablated: bool, as_json: bool) -> None:
    """Print which of two runs is better."""
    from roboeval.analysis.compare import compared, comparison_data, prompts, render, told_of, unlike
    from roboeval.analysis.metrics import score_by_prompt
    from roboeval.evaluation.run import load_head

    known = as_judged(paths[0], load(suite), ablated=ablated)
    evaluations = [open_evaluation(path, known, suite, ablated=ablated) for path in paths]
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
    names = str(paths[0]), str(paths[1])
    if as_json:
        print_json({**comparison_data(result, names), "warnings": unlike(*abouts)})
    else:
        print_rich(render(result, names))


def compare_suites(paths: Sequence[Path], suites: str, *, most: int, ablated: bool, as_json: bool) -> None:
    """Print what a second suite changes."""
    from roboeval.analysis.verdict_changes import render, reversals, reversals_data
    from roboeval.evaluation.completions import how_many

    if len({path.resolve() for path in paths}) < len(paths):
        fail("a run is named twice; name each once")
    found = []
    for path in paths:
        first, second = (judged_by(path, name, ablated=ablated) for name in two_suites(suites))
        programs = {completion.key: completion.program for completion in first[0].judged()}
        found.append(reversals(str(path), first[1], second[1], programs))
    for one in found:
        if one.left_out:
            note(f"{one.name}: left out, since only one suite has judged them: {how_many(one.left_out)}")
    if as_json:
        print_json(reversals_data(found))
    else:
        print_rich(render(found, most=most))


def two_suites(text: str) -> tuple[str, str]:
    """The suites that a user names, in their order."""
    names = [name.strip() for name in text.split(",")]
    if len(names) != PAIR or len({*names}) != PAIR or not all(names):
        fail(f'--suites takes two suites with a comma between them, such as paper,plus, and not "{text}"')
    return names[0], names[1]


def judged_by(path: Path, suite_name: str, *, ablated: bool) -> tuple[Evaluation, Judged]:
    """A run as a suite judges it, in the worlds in which it was judged."""
    from roboeval.analysis.verdict_changes import Judged

    suite = as_judged(path, load(suite_name), ablated=ablated)
    evaluation = open_evaluation(path, suite, suite_name, ablated=ablated)
    rows = watched(evaluation.rows(), "reading", evaluation.scope.total)
    judged = Judged.of(rows, suite, ablated=ablated)
    expect_current(evaluation, suite, suite_name)
    return evaluation, judged


def expect_alike(
    paths: Sequence[Path], evaluations: Sequence[Evaluation], suite: Suite, suite_name: str
) -> None:
    """Refuse runs that were judged by suites of different content."""
    from roboeval.analysis.compare import expect_same_suite

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

    from roboeval.analysis.resample import ran
    from roboeval.evaluation.engines import Local
    from roboeval.evaluation.run import evaluation_key
    from roboeval.evaluation.tables import key_of
    from roboeval.report.reading import read_run, scored

    ended: dict[Key, tuple[bool, bool]] = {}

    def noted(rows: Iterable[Row]) -> Iterator[Row]:
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
    return replace(run, trials=checked(evaluation, suite, ended, engine=Local(workers))) if check else run
