"""Formats comparisons of two runs and of two suites."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from codebotler.checking.storyboard import grid
from codebotler.core.terminal import visible
from codebotler.core.text.words import counted
from roboeval.analysis.comparisons.compare import (
    Comparison,
    comparison_sentence,
    p_text,
    sample_size_sentences,
)
from roboeval.analysis.comparisons.verdict_changes import VerdictChanges, ranks, sentences
from roboeval.analysis.failure_groups import FailureGroup
from roboeval.analysis.statistics import MIN_CLUSTERS
from roboeval.cli.views.groups import failure_group_view
from roboeval.cli.views.results import ruled
from roboeval.evaluation.judging.failures import classes_to_show, plural_of
from roboeval.evaluation.runs.results import Results


def comparison_view(
    comparison: Comparison,
    names: tuple[str, str],
    runs: Sequence[Results],
    failing: Sequence[Mapping[str, float]],
) -> RenderableType:
    """Return a view of a comparison. `failing` has each run's shares of completions by failure class."""
    a, b = map(visible, names)
    rows = grid("left", "right", "left")
    what = "missions that succeed:" if comparison.counts_missions else "pass@1 of"
    rows.add_row(f"{what} {a}", f"{comparison.first:.3f}", str(runs[0].coverage))
    rows.add_row(f"{what} {b}", f"{comparison.second:.3f}", str(runs[1].coverage))
    over = f"over {counted(comparison.prompts, 'prompt')} that both have"
    rows.add_row("difference, second minus first", f"{comparison.over_tasks.mean:+.3f}", over)
    few = "too narrow with so few tasks" * (1 < len(comparison.tasks) < MIN_CLUSTERS)
    for name, estimate, remark in (
        ("over tasks", comparison.over_tasks, p_text(comparison.p_tasks)),
        ("over prompts", comparison.over_prompts, p_text(comparison.p_prompts)),
        ("over tasks, by resampling (bootstrap)", comparison.bootstrap, few),
    ):
        rows.add_row(f"95% interval {name}", estimate.ends("+.3f"), remark)
    table = ruled("task", a, b, "difference", "adds", "prompts")
    for task in comparison.tasks:
        scores = f"{task.first:.3f}", f"{task.second:.3f}", f"{task.second - task.first:+.3f}"
        adds = f"{round(task.share, 9):+.3f}"
        table.add_row(Text(visible(task.task)), *scores, adds, str(task.prompts))
    sentence = Text(comparison_sentence(comparison, (a, b)), "bold")
    warnings = [
        Text(f"{name}: {warning}", "yellow")
        for name, run in zip((a, b), runs, strict=True)
        if (warning := run.scope.cut_off_warning) is not None
    ]
    needed = map(Text, sample_size_sentences(comparison))
    ends = ruled("share that fails", a, b)
    for name in classes_to_show([name for shares in failing for name, share in shares.items() if share]):
        ends.add_row(plural_of(name), *(f"{shares.get(name, 0.0):.1%}" for shares in failing))
    return Group(sentence, Text(), rows, Text(), *needed, *warnings, Text(), ends, Text(), table)


def changes_view(found: Sequence[VerdictChanges], *, most: int) -> RenderableType:
    """Return a view of the verdicts that a second suite changes. A list shows up to `most` groups."""
    parts: list[RenderableType] = [Text(visible(sentence), "bold") for sentence in sentences(found)]
    parts += [Text(), _scores(found)]
    for one in found:
        first, second = one.suites
        table = ruled(visible(one.name), "both", f"{first} only", f"{second} only", "neither")
        for task in one.tasks:
            counts = task.both, task.first_only, task.second_only, task.neither
            table.add_row(Text(visible(task.task)), *(f"{count:,}" for count in counts))
        parts += [Text(), table]
        parts += _groups(one.first_only, most, f"{first} only, and what {second} says")
        parts += _groups(one.second_only, most, f"{second} only, and what {first} says")
    return Group(*parts)


def _scores(found: Sequence[VerdictChanges]) -> Table:
    first, second = found[0].suites
    table = ruled("pass@1", first, second, "difference", "95% over tasks", "rank", "completions")
    ranked = ranks(found)
    for one in found:
        before, after = one.pass_at_1
        numbers = f"{before:.3f}", f"{after:.3f}", f"{after - before:+.3f}"
        interval = one.comparison.over_tasks.ends("+.3f")
        places = " -> ".join(dict.fromkeys(str(of[one.name]) for of in ranked))
        of = f"{one.completions:,} of {one.completions + one.left_out:,}"
        table.add_row(Text(visible(one.name)), *numbers, interval, places, of)
    return table


def _groups(every: Sequence[FailureGroup], most: int, what: str) -> list[RenderableType]:
    if not every:
        return []
    head = f"pass under {what}, in {len(every):,} group{'s' * (len(every) != 1)}:"
    left = len(every) - most
    more = [Text(f"{left:,} more groups; --groups shows more of them", "dim")] if left > 0 else []
    return [Text(), Text(head, "bold"), Text(), *map(failure_group_view, every[:most]), *more]
