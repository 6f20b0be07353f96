"""Formats the results of a run and of one of its tasks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rich import box
from rich.columns import Columns
from rich.console import Group, JustifyMethod, RenderableType
from rich.table import Table
from rich.text import Text

from codebotler.checking.storyboard import grid
from codebotler.core.terminal import visible
from codebotler.core.text.words import counted
from roboeval.analysis.counting.summary import EvaluationSummary, Failures
from roboeval.cli.views.completions import kind_view, prompt_lines
from roboeval.evaluation.judging.failures import classes_to_show, plural_of
from roboeval.evaluation.runs.completions import how_many, recorded_suffix

if TYPE_CHECKING:
    from roboeval.analysis.counting.broken_rules import BrokenRules


def ruled(*heads: str, first: JustifyMethod = "left") -> Table:
    """Create a table with a line below its header. All columns but the first are right-aligned."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for number, head in enumerate(heads):
        table.add_column(Text(head), justify="right" if number else first, overflow="fold")
    return table


def summary_view(summary: EvaluationSummary, *, title: str) -> RenderableType:
    """Return a view of an evaluation: its scores by task, its pass rates and its failures."""
    head = Text(visible(title) + recorded_suffix(summary.scope.models), style="bold")
    if summary.ablated:
        head.append(" (ablation: only common sense was required)", style="not bold")
    n, failed = summary.judged, sum(each.count for each in summary.failures)
    parts: list[RenderableType] = [head, Text(), _task_table(summary), Text()]
    parts += _overall(summary)
    if summary.missing:
        parts.append(Text(f"no results for {counted(len(summary.missing), 'task')}", style="dim"))
    if (warning := summary.scope.cut_off_warning) is not None:
        parts.append(Text(warning, style="yellow"))
    if failed:
        sentence = f"{failed:,} of {how_many(n)} failed ({failed / n:.1%}); shares are of all judged:"
        happened = [one.name for one in summary.failures if one.count]
        shown = happened if n == 1 else {*happened, *classes_to_show(happened)}
        listed = [_failure_table(one) for one in summary.failures if one.name in shown]
        parts += [Text(), Text(sentence), Text(), Columns(listed, padding=(1, 3))]
    return Group(*parts)


def house_view(found: BrokenRules) -> RenderableType:
    """Return a view of how often house rules were broken, and of their effect on pass@1."""
    table = grid("right", "left")
    for rule, count in found.by_rule.items():
        table.add_row(f"{count:,}", Text(visible(rule)))
    share = f"on average, {found.broken.mean:.1%} of a prompt's programs break a house rule"
    share += f" ({found.broken.interval})"
    parts: list[RenderableType] = [Text(), Text(share, "bold"), table]
    if found.cost is None:
        parts.append(Text("to see what the rules cost, also evaluate the run without --rules", "dim"))
    else:
        less = f"pass@1 with the rules minus pass@1 without: {found.cost.mean:+.3f}"
        parts.append(Text(f"{less} ({found.cost.interval})"))
    return Group(*parts)


def _task_table(summary: EvaluationSummary) -> Table:
    table = ruled("task", "completions", *(f"pass@{k}" for k in summary.k), "worst prompt", "best prompt")
    styles: dict[float, str] = {0: "red", 1: "green"}
    for task in summary.tasks:
        ends = task.lowest(summary.k[0]), task.highest(summary.k[0])
        shares = (*(task.pass_at(k).mean for k in summary.k), *ends)
        coverage = summary.scope.coverage(task.completions, task.task)
        of = "" if coverage.is_whole else f" of {coverage.total:,}"
        cells = (Text(f"{share:.2f}", styles.get(share, "")) for share in shares)
        table.add_row(Text(visible(task.task)), f"{coverage.judged:,}{of}", *cells)
    return table


def _overall(summary: EvaluationSummary) -> list[Text]:
    lines = []
    for k, estimate in zip(summary.k, summary.overall, strict=True):
        line = Text.assemble(f"pass@{k} over all prompts: ", (f"{estimate.mean:.3f}", "bold"))
        lines.append(line.append(f" ({estimate.interval})" if len(summary.prompts) > 1 else ""))
    tasks, prompts = counted(len(summary.tasks), "task"), counted(len(summary.prompts), "prompt")
    coverage = summary.coverage
    of = Text(f"{coverage}, {prompts} of {tasks}", style="" if coverage.is_whole else "yellow")
    missions = summary.scope.missions_sentence
    return [*lines, of, *([] if missions is None else [Text(missions)])]


def _failure_table(failures: Failures) -> Table:
    table = grid("left", "right", "right")
    rows = [(plural_of(failures.name), failures, "bold")]
    rows += [(f"  {kind.name}", kind, "") for kind in failures.kinds if kind.count]
    for name, one, style in rows:
        table.add_row(Text(visible(name)), f"{one.count:,}", f"{one.share:.1%}", style=style)
    return table


def task_view(data: Mapping[str, Any]) -> RenderableType:
    """Return a view of the results of each prompt of a task, from the data that `task_data` returns."""
    task = data["task"]
    models = {model for prompt in data["prompts"] for model in prompt["models"]}
    parts: list[RenderableType] = [Text(visible(task) + recorded_suffix(models), style="bold")]
    if data["summary"]:
        parts.append(Text(visible(data["summary"])))
    for prompt in data["prompts"]:
        parts += [Text(), *prompt_lines(task, prompt)]
        table = grid("right", "left", "left")
        for failure in prompt["failures"]:
            example = Text(f"such as {visible(task)}/{prompt['prompt']}/{failure['example']}", "dim")
            table.add_row(f"  {failure['count']:,}", kind_view(failure), example)
        parts.append(table)
    return Group(*parts)
