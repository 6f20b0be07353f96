"""Defines the command find, which searches completions by behaviour and groups the failures."""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from codebotler.core.errors import UserError
from roboeval.cli.inputs import open_with_results
from roboeval.cli.options import AblationOption, JsonOption, RunArgument, SuiteOption
from roboeval.cli.output import fail, note, print_json, print_rich, show_progress

if TYPE_CHECKING:
    from codebotler.rtl import Formula
    from roboeval.analysis.search import TraceMatch
    from roboeval.evaluation.runs.completions import CompletionKey


def find(
    run: RunArgument,
    formula: Annotated[
        str | None, typer.Argument(help='An RTL formula, such as tr.Exists(goto("kitchen")); default: all.')
    ] = None,
    negated: Annotated[
        bool, typer.Option("--not", help="Find completions whose traces do not satisfy the formula.")
    ] = False,
    task: Annotated[str | None, typer.Option(help="Only completions for this task.")] = None,
    world: Annotated[
        str | None, typer.Option(help="Search only the world with this number (from 1) or description.")
    ] = None,
    most: Annotated[int, typer.Option("--groups", min=0, help="Number of failure groups to show.")] = 10,
    suite: SuiteOption = "paper",
    ablation: AblationOption = False,
    json: JsonOption = False,
) -> None:
    """Find completions by what they did, and group the failures.

    A completion is found if its trace satisfies the formula in some world. Failures are grouped by reason.
    """
    from roboeval.analysis.failure_groups import describe_groups, group_data, group_failures
    from roboeval.analysis.search import TraceQuery, search_row
    from roboeval.cli.views.groups import found_view
    from roboeval.evaluation.runs.completions import how_many

    if negated and formula is None:
        fail("--not needs a formula; add one, or leave out --not")
    parsed = None if formula is None else parse_formula(formula)
    results = open_with_results(run, suite, ablated=ablation)
    task = None if task is None else results.required_suite.task(task).name
    query = TraceQuery(parsed, negated, task, world)
    matches = (search_row(results.row(key), query) for key in results.places)
    every = list(show_progress(matches, "searching", len(results.places)))
    total = sum(one.is_in_scope for one in every)
    if world is not None and not total:
        of = "" if task is None else f" of {task}"
        fail(f'no completion{of} was judged in a world "{world}"; `roboeval tasks TASK` lists the worlds')
    found = [one for one in every if one.worlds]
    passed = {*results.passed}
    failed = [results.row(one.key) for one in found if one.key not in passed]
    together = group_failures(failed, results.programs)
    shown = together if json else together[:most]
    described = list(show_progress(describe_groups(shown, results), "comparing", len(shown)))
    undecided = [one for one in every if one.cut]
    if undecided:
        note(f"undecided because their traces were too long to save: {how_many(len(undecided))}")
    if json:
        data = {
            "looked_at": total,
            "found": [found_data(one, one.worlds, passed) for one in found],
            "undecided": [found_data(one, one.cut, passed) for one in undecided],
        }
        print_json({**data, "groups": list(map(group_data, described))})
    else:
        is_search = formula is not None
        print_rich(found_view(found, passed, total, described, groups=len(together), is_search=is_search))


def parse_formula(text: str) -> Formula:
    """Parse an RTL formula. Raise UserError if it is invalid."""
    from codebotler.rtl import RtlSyntaxError, parse

    try:
        return parse(text)
    except RtlSyntaxError as error:
        raise UserError(f"the formula is not valid: {error}") from None


def found_data(
    one: TraceMatch, worlds: Sequence[tuple[int, str]], passed: Container[CompletionKey]
) -> dict[str, Any]:
    """Convert a search result to JSON data: the completion, whether it passed, and `worlds`."""
    from roboeval.evaluation.runs.completions import name_of

    return {
        "completion": name_of(one.key),
        "passed": one.key in passed,
        "worlds": [{"number": number, "world": world} for number, world in worlds],
    }
