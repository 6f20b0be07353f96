"""Defines the commands show, export and serve, which present judged runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codebotler.cli.options import (
    BehindProxyOption,
    HostOption,
    NameOption,
    NoTokenOption,
    PortOption,
    TokenOption,
)
from codebotler.core.errors import UserError
from roboeval.cli.inputs import (
    expect_judged,
    load_suite_option,
    names_completion,
    open_run,
    open_with_results,
    parse_selection,
    unjudged_sentence,
)
from roboeval.cli.options import (
    AblationOption,
    HouseRulesOption,
    JsonOption,
    RunArgument,
    SuiteOption,
    path_to,
)
from roboeval.cli.output import fail, note, print_json, print_rich

if TYPE_CHECKING:
    from polars import DataFrame

    from roboeval.analysis.counting.broken_rules import BrokenRules
    from roboeval.analysis.counting.summary import EvaluationSummary
    from roboeval.evaluation.runs.completions import CompletionKey
    from roboeval.evaluation.runs.folder import RunFolder
    from roboeval.evaluation.runs.results import Results
    from roboeval.suites.load import Suite


def show(
    run: RunArgument,
    what: Annotated[
        str | None, typer.Argument(help="Show only TASK, TASK/PROMPT or TASK/PROMPT/INDEX.")
    ] = None,
    suite: SuiteOption = "paper",
    ablation: AblationOption = False,
    rules: HouseRulesOption = None,
    k: Annotated[list[int] | None, typer.Option("--k", min=1, help="Also show pass@k for this k.")] = None,
    in_full: Annotated[
        bool, typer.Option("--all", help="For a completion, also show the steps in worlds where it passes.")
    ] = False,
    with_reply: Annotated[
        bool, typer.Option("--reply", help="For a completion, also show the original reasoning and reply.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Print a run's tables, or show why a completion fails."""
    if what and k:
        fail(f"--k applies to a whole run; leave out {what} or --k")
    if what and ablation:
        note("ablation: only common sense was required")
    is_one = what is not None and names_completion(what)
    if not is_one and (in_full or with_reply):
        option = "--all" if in_full else "--reply"
        fail(f"{option} applies to one completion; give TASK/PROMPT/INDEX, or leave out {option}")
    judged = open_run(run, suite, ablated=ablation, rules=rules, completion=what if is_one else None)
    if not what:
        show_run(judged, k or [], title=str(run), has_rules=rules is not None, as_json=json)
    else:
        part = task, *numbers = parse_selection(what, judged.required_suite)
        expect_judged(part, judged.places)
        if is_one:
            key = task, numbers[0], numbers[1]
            show_completion(judged, key, in_full=in_full, with_reply=with_reply, as_json=json)
        else:
            show_part(judged, task, numbers[0] if numbers else None, as_json=json)
    if not is_one and (unjudged := unjudged_sentence(judged, suite, rules)) is not None:
        note(unjudged)


def broken_rules_of(run: RunFolder | None, suite: Suite, table: DataFrame, *, ablated: bool) -> BrokenRules:
    """Count broken house rules in a table. Compare pass@1 with the evaluation without rules, if any."""
    from roboeval.analysis.counting.broken_rules import count_broken_rules
    from roboeval.evaluation.runs.folder import evaluation_key
    from roboeval.evaluation.runs.results import read_results

    key = evaluation_key(suite.with_house_rules(None), ablated=ablated)
    if run is None or not run.rows(key).is_file():
        return count_broken_rules(table)
    return count_broken_rules(table, read_results(run, key, suite).table)


def print_summary(
    counted: EvaluationSummary, *, title: str, as_json: bool, house: BrokenRules | None = None
) -> None:
    """Print an evaluation's tables under a title, or its data as JSON. `house` adds broken house rules."""
    from roboeval.analysis.counting.summary import summary_data
    from roboeval.cli.views.results import house_view, summary_view

    if as_json:
        data = summary_data(counted)
        if house is not None:
            from roboeval.analysis.counting.broken_rules import broken_rules_data

            data["house_rules"] = broken_rules_data(house)
        print_json(data)
    else:
        print_rich(summary_view(counted, title=title))
        if house is not None:
            print_rich(house_view(house))


def show_run(results: Results, k: list[int], *, title: str, has_rules: bool, as_json: bool) -> None:
    """Print a run's tables or JSON: pass@1, pass@k for each `k` and, if `has_rules`, broken house rules."""
    from roboeval.analysis.counting.counts import tally_of
    from roboeval.analysis.counting.summary import summarise

    ablated, suite = results.is_ablated, results.required_suite
    counted = summarise(tally_of(results.table), suite, results.scope, k=sorted({1, *k}), ablated=ablated)
    house = broken_rules_of(results.run, suite, results.table, ablated=ablated) if has_rules else None
    print_summary(counted, title=title, as_json=as_json, house=house)


def show_part(results: Results, task: str, prompt: int | None, *, as_json: bool) -> None:
    """Print the results of a task or, if a prompt number is given, of one of its prompts."""
    from roboeval.analysis.counting.tasks import prompt_data, task_data
    from roboeval.cli.views.completions import prompt_view
    from roboeval.cli.views.results import task_view

    data = task_data(results, task) if prompt is None else prompt_data(results, task, prompt)
    if as_json:
        print_json({**data, "ablation": results.is_ablated})
    else:
        print_rich(task_view(data) if prompt is None else prompt_view(data))


def show_completion(
    judged: Results, key: CompletionKey, *, in_full: bool, with_reply: bool, as_json: bool
) -> None:
    """Print a completion's program and the reasons for its verdict: as `completion_view`, or as JSON."""
    from roboeval.cli.views.completions import completion_view
    from roboeval.evaluation.judging.explanation import completion_data

    written = judged.completions[key]
    data = completion_data(judged.row(key), written, judged.suite, ablated=judged.is_ablated)
    if as_json:
        print_json({**data, "ablation": judged.is_ablated})
    else:
        print_rich(completion_view(data, in_full=in_full, with_reply=with_reply))


def export(
    run: RunArgument,
    format: Annotated[  # noqa: A002 - the option's name
        str | None, typer.Option(help="Either csv or parquet; by default the suffix of --out, or else csv.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="The file to write; by default next to the verdicts.", parser=path_to("a file")),
    ] = None,
    suite: SuiteOption = "paper",
    ablation: AblationOption = False,
    price: Annotated[
        str | None, typer.Option(help="INPUT/OUTPUT, the prices per million tokens, for the column `cost`.")
    ] = None,
) -> None:
    """Write a run's verdicts to a file as one flat table."""
    from codebotler.core.files import expect_replaceable
    from roboeval.evaluation.runs.table import TABLE_BEGINNINGS, Price, table_format, with_cost, write_table

    kind = format or table_format(out)
    cost = None if price is None else Price.read(price)
    results = open_with_results(run, suite, ablated=ablation)
    table = results.table if cost is None else with_cost(results.table, cost)
    path = out or results.run.rows(str(results.key)).with_suffix(f".{kind}")
    expect_replaceable(path, *TABLE_BEGINNINGS)
    write_table(table, path, kind)
    note(f"the table is in {path}")


def serve(
    runs: Annotated[Path, typer.Argument(help="A folder of runs, or a single run.")] = Path("runs"),
    host: HostOption = "127.0.0.1",
    port: PortOption = None,
    name: NameOption = None,
    behind_proxy: BehindProxyOption = None,
    token: TokenOption = None,
    no_token: NoTokenOption = False,
    suite: Annotated[
        list[str] | None,
        typer.Option(help="A folder with a suite that judged the runs; may be given several times."),
    ] = None,
) -> None:
    """Show runs in a browser.

    You can compare runs and inspect each completion, without a robot. Ctrl-C stops the server.
    """
    from codebotler.web import server
    from codebotler.web.security.access import Access, PageAddress
    from codebotler.web.security.proxy import proxies_in_front
    from roboeval.web.pages import pages
    from roboeval.web.run_store import RunStore

    place = PageAddress(host, port, tuple(name or ()), proxies_in_front(behind_proxy))
    access = Access.from_options(token, None, open_to_all=no_token, is_private=place.is_private)
    if not runs.is_dir():
        raise UserError("the folder does not exist; `roboeval run` creates it with the first run", file=runs)
    suites = [load_suite_option(each) for each in suite or ()]
    if not RunStore(runs).names():
        note(f"{runs} contains no runs yet; new runs will appear on the page")
    server.serve(None, place, access, (pages(suites),), runs)
