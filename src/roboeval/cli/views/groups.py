"""Formats found completions, groups of failures, and the results of rejection sampling."""

from __future__ import annotations

from collections.abc import Container, Sequence

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from codebotler.core.terminal import shortened, visible
from codebotler.core.text.words import counted
from roboeval.analysis.failure_groups import FailureGroup
from roboeval.analysis.resample import THRESHOLDS, CheckedPrompt, resample
from roboeval.analysis.search import TraceMatch
from roboeval.cli.views.completions import kind_view
from roboeval.cli.views.results import ruled
from roboeval.evaluation.runs.completions import CompletionKey, how_many, name_of
from roboeval.evaluation.runs.scope import Coverage
from roboeval.suites.task import plain_check

MAX_PRINTED_CHANGES = 60  # lines of a diff between programs


def found_view(
    found: Sequence[TraceMatch],
    passed: Container[CompletionKey],
    total: int,
    shown: Sequence[FailureGroup],
    *,
    groups: int,
    is_search: bool,
) -> RenderableType:
    """Return a view of the completions `found` among `total`, and of the groups `shown` among `groups`.

    If `is_search`, the view starts with the number of found completions of each task.
    """
    failed = sum(one.key not in passed for one in found)
    parts: list[RenderableType] = []
    if is_search:
        parts += [Text(f"found {len(found):,} of {how_many(total)}", "bold"), Text()]
        parts += [_by_task(found, passed), Text()] if found else []
    if failed or not is_search:
        of = "these" if is_search else f"{total:,}"
        grouped = f", in {counted(groups, 'group')}" * (groups > 0)
        parts.append(Text(f"{how_many(failed)} of {of} failed{grouped}{':' * bool(shown)}", "bold"))
    if shown:
        parts += [Text(), *map(failure_group_view, shown)]
        if groups > len(shown):
            parts.append(Text(f"{groups - len(shown):,} more groups; --groups shows more of them", "dim"))
    return Group(*parts)


def _by_task(found: Sequence[TraceMatch], passed: Container[CompletionKey]) -> Table:
    table = ruled("task", "found", "passed")
    table.add_column("such as")
    by_task: dict[str, list[TraceMatch]] = {}
    for one in found:
        by_task.setdefault(one.key[0], []).append(one)
    for task, those in by_task.items():
        example = f"{name_of(those[0].key)}, world {those[0].worlds[0][0]}"
        counts = len(those), sum(one.key in passed for one in those)
        table.add_row(Text(visible(task)), *(f"{count:,}" for count in counts), Text(visible(example), "dim"))
    return table


def failure_group_view(group: FailureGroup) -> RenderableType:
    """Return a view of a group of failures: its size, the reason, and the most similar passing program."""
    size = how_many(len(group.members))
    name = visible(name_of(group.representative))
    head = Text.assemble((size, "bold"), f" of {visible(group.task)}, ", kind_view(group.failure))
    world = "" if group.has_no_program else f', in "{visible(str(group.reason["world"]))}"'
    lines = [Text(f"such as {name}{world}", "dim")]
    check = group.failure["check"]
    lines.append(Text(shortened(f"{plain_check(check)}: {group.why}" if check else group.why)))
    if (fix := group.fix) is not None:
        changed = f"{fix.changed} line{'s' * (fix.changed != 1)}"
        lines.append(Text(f"{visible(fix.name)} passes, and differs in {changed}:", "dim"))
        for sign, line in fix.changes[:MAX_PRINTED_CHANGES]:
            style = {"-": "red", "+": "green"}.get(sign, "dim")
            lines.append(Text(f"{sign} {shortened(line.expandtabs(4))}", style))
        if (left := len(fix.changes) - MAX_PRINTED_CHANGES) > 0:
            lines.append(Text(f"... {left} more lines", "dim"))
    return Group(head, *(Padding(line, (0, 0, 0, 2)) for line in lines), Text())


def resample_view(
    prompts: Sequence[CheckedPrompt], limits: Sequence[int], *, title: str, coverage: Coverage
) -> RenderableType:
    """Return a view of the results of rejection sampling, with a row for each limit on retries."""
    reaching = (f"pass@1\n≥ {t:g}" for t in THRESHOLDS)
    table = ruled("retries", "pass@1", *reaching, "accepted", "run at all", first="right")
    for limit in (resample(prompts, retries) for retries in limits):
        shares = (*limit.prompts.values(), limit.accepted, limit.ran)
        table.add_row(f"{limit.retries}", f"{limit.passed.mean:.3f}", *(f"{share:.1%}" for share in shares))
    ran = "run at all: the share of programs that run without an error in all worlds of their task"
    return Group(
        Text(visible(title), style="bold"),
        Text("results if each program that the check rejects is regenerated:"),
        Text(),
        table,
        Text(),
        Text(f"over {coverage}", "" if coverage.is_whole else "yellow"),
        Text("pass@1 ≥ x: the share of prompts with a pass@1 of at least x", style="dim"),
        Text("accepted: the share of final programs that the check accepts", style="dim"),
        Text(ran, style="dim"),
    )
