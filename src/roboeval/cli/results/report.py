"""Defines the command report, which writes figures and a web page about runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roboeval.cli.inputs import command, expect_same_suite, open_with_results
from roboeval.cli.options import HouseRulesOption, SuiteOption, WorkersOption, path_to
from roboeval.cli.output import fail, note, show_progress
from roboeval.cli.results.compare import check_run

if TYPE_CHECKING:
    from roboeval.evaluation.engines.engine import OpenEngine
    from roboeval.evaluation.runs.results import Results
    from roboeval.report.runs import JudgedRun

PublishedOption = Annotated[
    bool, typer.Option("--published", help="Add the failure causes that the paper published.")
]
PricesOption = Annotated[
    list[str] | None,
    typer.Option(help="MODEL=INPUT/OUTPUT, the prices per million tokens; may be given several times."),
]
LabelsOption = Annotated[
    list[str] | None,
    typer.Option(help="RUN=TEXT, the name of a run in tables and figures; may be given several times."),
]
BesideOption = Annotated[
    str | None, typer.Option(help="Compare with the verdicts of another suite that judged the runs.")
]
CheckOption = Annotated[
    bool, typer.Option(help="Run the check on programs not checked yet, for rejection sampling.")
]


def report(
    runs: Annotated[list[Path], typer.Argument(help="Judged runs.", parser=path_to("a run"))],
    out: Annotated[Path, typer.Option(help="The folder to write to.", parser=path_to("a folder"))],
    suite: SuiteOption = "paper",
    published: PublishedOption = False,
    price: PricesOption = None,
    label: LabelsOption = None,
    beside: BesideOption = None,
    check: CheckOption = True,
    workers: WorkersOption = None,
    rules: HouseRulesOption = None,
) -> None:
    """Write a report with figures, tables and a web page.

    The report has the paper's figures. Its page also shows why programs fail and how certain the numbers are.
    """
    import atexit
    import gc

    gc.disable()  # garbage collection would take a fifth of the time
    atexit.register(gc.freeze)  # skip the collection at exit, too
    from codebotler.core.terminal import busy
    from codebotler.simulator.pool import cores
    from roboeval.evaluation.engines.engine import Local
    from roboeval.report.runs import name_runs, price_runs, read_labels, read_prices
    from roboeval.report.writing import count_parts, expect_no_others, headline, sections, write_report

    expect_no_others(out)
    prices, labels = read_prices(price or ()), read_labels(label or (), runs)
    if beside == suite:
        fail(f'--beside names "{suite}", which the report itself uses; name a different suite')
    opened = [open_with_results(run, suite, ablated=False) for run in runs]
    expect_same_suite(opened, suite)
    engine = Local(workers or cores()) if check else None
    read = [judged_run(one, suite, beside=beside, rules=rules, engine=engine) for one in opened]
    read = price_runs(name_runs(read, labels), prices)
    options: list[object] = ["--out", out, *["--published"] * published]
    options += [] if beside is None else ["--beside", beside]
    options += [] if rules is None else ["--rules", rules]
    options += ["--no-check"] * (not check)
    options += [word for text in price or () for word in ("--price", text)]
    options += [word for text in label or () for word in ("--label", text)]
    again = command("report", *runs, *options, suite=suite)
    with busy("assembling the report"):
        parts = sections(read, with_published=published, command=again)
    for _ in show_progress(write_report(*headline(read), parts, out), "writing", count_parts(parts)):
        pass
    note(f"the report is in {out / 'index.html'}")


def judged_run(
    results: Results, suite: str, *, beside: str | None, rules: Path | None, engine: OpenEngine | None
) -> JudgedRun:
    """Return a run for a report, with its verdicts in the ablation, in the suite `beside` and under `rules`.

    The engine runs the program check. Without an engine, the report leaves out rejection sampling.
    """
    import polars as pl

    from roboeval.evaluation.runs.folder import evaluation_key
    from roboeval.report.runs import JudgedRun

    run = results.run
    ablated = other = house = None
    if run.rows(evaluation_key(results.required_suite, ablated=True)).is_file():
        ablated = open_with_results(run.path, suite, ablated=True, reuse_from=results)
    if engine is None:
        table = results.table.with_columns(accepted=pl.lit(None, dtype=pl.Boolean))
    else:
        table = check_run(results, engine)
    if beside is not None:
        other = open_with_results(run.path, beside, ablated=False, reuse_from=results)
    if rules is not None:
        house = open_with_results(run.path, suite, ablated=False, rules=rules, reuse_from=results)
    return JudgedRun(results, table, ablated=ablated, other_suite=other, house=house)
