"""The commands show, export and serve, which show what was judged."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codebotler.cli.options import HostOption, NameOption, NoTokenOption, PortOption, TokenOption
from roboeval.cli.options import (
    AblationOption,
    JsonOption,
    RulesOption,
    RunArgument,
    SuiteOption,
    command,
    complaint_of,
    load,
    named,
    note_houses,
    open_current,
    open_run,
    task_names,
    unfinished_of,
)
from roboeval.cli.output import fail, note, print_json, print_rich

if TYPE_CHECKING:
    from polars import DataFrame

    from roboeval.analysis.broken_rules import BrokenRules
    from roboeval.analysis.summary import Summary
    from roboeval.evaluation.runs.completions import Key
    from roboeval.evaluation.runs.folder import Run
    from roboeval.evaluation.runs.results import Results
    from roboeval.suites.load import Suite


def show(
    run: RunArgument,
    what: Annotated[
        str | None,
        typer.Argument(help="TASK, TASK/PROMPT or TASK/PROMPT/INDEX.", autocompletion=task_names),
    ] = None,
    suite: SuiteOption = "paper",
    ablation: AblationOption = False,
    rules: RulesOption = None,
    k: Annotated[list[int] | None, typer.Option("--k", min=1, help="Also pass@k for this k.")] = None,
    json: JsonOption = False,
) -> None:
    """Print a run's tables, or show why a completion fails."""
    from roboeval.analysis.counts import tally_of
    from roboeval.analysis.summary import summary
    from roboeval.analysis.tasks import parse_selection

    results, again = open_run(run, suite, ablated=ablation, rules=rules)
    selection = parse_selection(what, results.known_suite)
    if selection.task is None:
        ks = sorted({1, *(k or [])})
        counted = summary(tally_of(results.table), results.known_suite, results.scope, k=ks, ablated=ablation)
        house = (
            None
            if rules is None
            else house_of(results.run, results.known_suite, results.table, ablated=ablation)
        )
        print_summary(counted, title=str(run), as_json=json, stale=results.stale, house=house)
        if rules is None:
            note_houses([results.run], suite)
    else:
        if k:
            fail(f"--k applies to a whole run; leave out {selection} or --k")
        if ablation:
            note("ablation: only common sense was required")
        selection.expect_judged(results)
        show_part(results, selection.task, selection.prompt, selection.index, as_json=json)
        if selection.prompt is not None and selection.index is not None:
            _note_nearest(results, (selection.task, selection.prompt, selection.index), suite)
    if (complaint := complaint_of(results)) is not None:
        note(f"{complaint}; `{again} --redo` judges the current programs")
    if (unfinished := unfinished_of(results)) is not None:
        note(f"{unfinished}; `{again}` continues")


def house_of(run: Run | None, suite: Suite, table: DataFrame, *, ablated: bool) -> BrokenRules:
    """How a run did by the rules of a house, beside its evaluation without them if there is one."""
    from roboeval.analysis.broken_rules import broken_rules
    from roboeval.evaluation.runs.folder import evaluation_key
    from roboeval.evaluation.runs.results import read_results

    key = evaluation_key(suite.with_house_rules(None), ablated=ablated)
    if run is None or not run.rows(key).is_file():
        return broken_rules(table)
    return broken_rules(table, read_results(run, key, suite, keep_failed=False).table)


def print_summary(
    counted: Summary,
    *,
    title: str,
    as_json: bool,
    stale: Iterable[Key] = (),
    house: BrokenRules | None = None,
) -> None:
    """Print the tables of an evaluation."""
    from roboeval.analysis.summary import summary_data
    from roboeval.cli.views.results import house_view, summary_view
    from roboeval.evaluation.runs.completions import name_of

    if as_json:
        data = {**summary_data(counted), "stale": list(map(name_of, stale))}
        if house is not None:
            from roboeval.analysis.broken_rules import broken_rules_data

            data["house_rules"] = broken_rules_data(house)
        print_json(data)
    else:
        print_rich(summary_view(counted, title=title))
        if house is not None:
            print_rich(house_view(house))


def show_part(results: Results, task: str, prompt: int | None, index: int | None, *, as_json: bool) -> None:
    """Print a task, a prompt or a completion."""
    from roboeval.analysis.tasks import prompt_data, task_data
    from roboeval.cli.views.completions import completion_view, prompt_view
    from roboeval.cli.views.results import task_view
    from roboeval.evaluation.explanation import completion_data

    if prompt is None:
        data, view = task_data(results, task), task_view
    elif index is None:
        data, view = prompt_data(results, task, prompt), prompt_view
    else:
        key = task, prompt, index
        completion = None if key in results.stale else results.completions.get(key)
        data = completion_data(results.row(key), completion, results.suite, ablated=results.is_ablated)
        view = completion_view
    if as_json:
        print_json({**data, "ablation": results.is_ablated})
    else:
        print_rich(view(data))


def _note_nearest(results: Results, key: Key, suite: str) -> None:
    """Note the command that shows the program nearest to one that fails."""
    from codebotler.core.words import counted
    from roboeval.analysis.cluster import nearest_fix

    if key in results.failed and (fix := nearest_fix(results, key)) is not None:
        again = command("show", results.run.path, fix.name, suite=suite, ablated=results.is_ablated)
        note(f"the nearest program that passes differs in {counted(fix.changed, 'line')}: `{again}`")


def export(
    run: RunArgument,
    format: Annotated[  # noqa: A002 - the option's name
        str | None, typer.Option(help="csv or parquet; by default the ending of --out, or csv.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The file; by default beside the verdicts.", parser=named("a file"))
    ] = None,
    suite: SuiteOption = "paper",
    ablation: AblationOption = False,
    price: Annotated[
        str | None, typer.Option(help="INPUT/OUTPUT, the prices of a million tokens, for the column cost.")
    ] = None,
) -> None:
    """Write a run's verdicts as one flat table."""
    from codebotler.core.files import expect_replaceable
    from roboeval.evaluation.runs.table import BEGINNINGS, Price, kind_of, with_cost, write_table

    kind = format or kind_of(out)
    try:
        cost = None if price is None else Price.read(price)
    except ValueError:
        fail(f'"{price}" is not a price; write INPUT/OUTPUT, each for a million tokens')
    results = open_current(run, suite, ablated=ablation).results
    table = results.table if cost is None else with_cost(results.table, cost)
    path = out or results.run.rows(str(results.key)).with_suffix(f".{kind}")
    expect_replaceable(path, *BEGINNINGS)
    write_table(table, path, kind)
    note(f"the table is in {path}")


def serve(
    runs: Annotated[Path, typer.Argument(help="A folder of runs, or one run.")] = Path("runs"),
    host: HostOption = "127.0.0.1",
    port: PortOption = None,
    name: NameOption = None,
    token: TokenOption = None,
    no_token: NoTokenOption = False,
    suite: Annotated[
        list[str] | None,
        typer.Option(help="The folder of a suite that judged the runs; may be given several times."),
    ] = None,
) -> None:
    """Show runs in a browser.

    Compare runs, and look into each completion; Ctrl-C ends it. No robot is needed.
    """
    from codebotler.core.errors import UserError
    from codebotler.web import server
    from codebotler.web.access import Access, Place
    from roboeval.web.pages import pages
    from roboeval.web.run_store import RunStore

    place = Place(host, port, tuple(name or ()))
    access = Access.asked_for(token, None, open_to_all=no_token, is_loopback=place.is_loopback)
    if not runs.is_dir():
        raise UserError("there is no such folder; `roboeval run` makes the first run in runs/", file=runs)
    suites = [load(each) for each in suite or ()]
    if not RunStore(runs).names():
        note(f"{runs} has no runs yet; new ones will be shown")
    server.serve(None, place, access, (pages(suites),), runs)
