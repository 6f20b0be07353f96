"""Views of a comparison of two runs, and of two suites."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from codebotler.checking.storyboard import grid
from codebotler.core.terminal import visible
from codebotler.core.words import counted
from roboeval.analysis.cluster import Cluster
from roboeval.analysis.compare import Comparison, p_text, to_tell, verdict
from roboeval.analysis.statistics import FEW
from roboeval.analysis.verdict_changes import VerdictChanges, place, sentences
from roboeval.cli.views.groups import cluster_view
from roboeval.cli.views.results import ruled


def comparison_view(comparison: Comparison, names: tuple[str, str]) -> RenderableType:
    """A comparison as text and tables."""
    a, b = map(visible, names)
    rows = grid("left", "right", "left")
    rows.add_row(f"pass@1 of {a}", f"{comparison.first:.3f}")
    rows.add_row(f"pass@1 of {b}", f"{comparison.second:.3f}")
    over = f"over {counted(comparison.prompts, 'prompt')} that both have"
    rows.add_row("difference, second minus first", f"{comparison.over_tasks.mean:+.3f}", over)
    tasks = len(comparison.tasks)
    few = (
        "one task says nothing about others" if tasks == 1 else "too narrow for so few tasks" * (tasks < FEW)
    )
    for name, estimate, of, told in (
        ("prompts drawn at random", comparison.over_prompts, "prompts", p_text(comparison.p_prompts)),
        ("tasks drawn at random", comparison.over_tasks, "tasks", p_text(comparison.p_tasks)),
        ("tasks drawn again (bootstrap)", comparison.bootstrap, "tasks", few),
    ):
        row = estimate.ends("+.3f"), told
        if not estimate.is_known:
            row = "unknown", f"all {of} are alike; {told}"
        rows.add_row(f"95% interval, {name}", *row)
    table = ruled("task", a, b, "difference", "adds", "prompts")
    for task in comparison.tasks:
        cells = (f"{task.first:.3f}", f"{task.second:.3f}", f"{task.difference:+.3f}", f"{task.share:+.3f}")
        table.add_row(Text(visible(task.task)), *cells, str(task.prompts))
    sentence = Text(verdict(comparison, (a, b)), "bold")
    return Group(sentence, Text(), rows, Text(), *map(Text, to_tell(comparison)), Text(), table)


def changes_view(found: Sequence[VerdictChanges], *, most: int) -> RenderableType:
    """What a second suite changes, with at most `most` groups of programs for each run and direction."""
    parts: list[RenderableType] = [Text(visible(sentence), "bold") for sentence in sentences(found)]
    parts += [Text(), _scores(found)]
    for one in found:
        parts += [Text(), _tasks(one)]
        first, second = one.suites
        parts += _groups(one.first_only, most, f"{first} only, and what {second} says")
        parts += _groups(one.second_only, most, f"{second} only, and what {first} says")
    return Group(*parts)


def _scores(found: Sequence[VerdictChanges]) -> Table:
    first, second = found[0].suites
    table = ruled("pass@1", first, second, "difference", "95% over prompts", "place")
    scores = [{one.name: one.pass_at_1[side] for one in found} for side in (0, 1)]
    for one in found:
        before, after = one.pass_at_1
        ends = one.comparison.over_prompts
        numbers = f"{before:.3f}", f"{after:.3f}", f"{after - before:+.3f}"
        interval = ends.ends("+.3f")
        places = " -> ".join(dict.fromkeys(str(place(one.name, of)) for of in scores))
        table.add_row(Text(visible(one.name)), *numbers, interval, places)
    return table


def _tasks(one: VerdictChanges) -> Table:
    first, second = one.suites
    table = ruled(visible(one.name), "both", f"{first} only", f"{second} only", "neither")
    for task in one.tasks:
        counts = task.both, task.first_only, task.second_only, task.neither
        table.add_row(Text(visible(task.task)), *(f"{count:,}" for count in counts))
    return table


def _groups(every: Sequence[Cluster], most: int, what: str) -> list[RenderableType]:
    if not every:
        return []
    head = f"pass under {what}, in {len(every):,} group{'s' * (len(every) != 1)}:"
    left = len(every) - most
    more = [Text(f"{left:,} more groups; --groups shows more of them", "dim")] if left > 0 else []
    return [Text(), Text(head, "bold"), Text(), *map(cluster_view, every[:most]), *more]
