"""How the completions of an evaluation did: how often programs succeed and how they fail, counted."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich import box
from rich.columns import Columns
from rich.console import Console, ConsoleOptions, Group, RenderableType
from rich.table import Table
from rich.text import Text

from codebotler.badinput import BadInput
from codebotler.storyboard import grid
from codebotler.terminal import visible
from roboeval.analysis.metrics import Estimate, PromptScore, TaskScore, overall, score_by_prompt
from roboeval.evaluation.completions import how_many
from roboeval.evaluation.evaluation import Scope
from roboeval.evaluation.failures import CATEGORIES, CLASSES, PYTHON, PYTHON_KINDS, ROBOT, ROBOT_KINDS, TASK
from roboeval.evaluation.tables import RowData, by_hand
from roboeval.suites.load import Suite

ALWAYS_SHOWN: Mapping[str, Sequence[str]] = {PYTHON: PYTHON_KINDS, ROBOT: ROBOT_KINDS, TASK: CATEGORIES}


@dataclass(frozen=True)
class Failures:
    """How many completions failed by one class or one kind of it.

    Args:
        name: of the class or kind.
        count: of completions.
        share: of all completions.
        kinds: of a class; the known ones come first, also where nothing failed by them.
    """

    name: str
    count: int
    share: float
    kinds: tuple[Failures, ...] = ()


@dataclass(frozen=True)
class Summary:
    """An evaluation in numbers.

    Args:
        k: of the pass@k that were asked for.
        tasks: those that have completions, in the suite's order.
        overall: pass@k over all prompts with a 95 % interval, for each k.
        failures: by class.
        scope: what there is to judge.
        missing: tasks of the suite that have no score.
        ablated: whether common sense only was required.
    """

    k: tuple[int, ...]
    tasks: tuple[TaskScore, ...]
    overall: tuple[Estimate, ...]
    failures: tuple[Failures, ...]
    scope: Scope
    missing: Missing
    ablated: bool = False

    @property
    def prompts(self) -> list[PromptScore]:
        """The scores of all prompts of all tasks."""
        return [prompt for task in self.tasks for prompt in task.prompts]


@dataclass(frozen=True)
class Missing:
    """Tasks of a suite that have no score, by the reason.

    Args:
        no_completions: nobody wrote a program for them.
        not_judged: there are completions, and none has been judged yet.
        not_selected: they were not asked for.
    """

    no_completions: tuple[str, ...] = ()
    not_judged: tuple[str, ...] = ()
    not_selected: tuple[str, ...] = ()


def summary(
    rows: Iterable[RowData],
    suite: Suite,
    *,
    k: Sequence[int] = (1,),
    scope: Scope | None = None,
    ablated: bool = False,
) -> Summary:
    """Count how the completions of an evaluation did.

    Args:
        rows: of the evaluation; read once and not kept.
        suite: by which they were judged.
        k: how many tries pass@k allows.
        scope: what there is to judge; what the rows judge by default.
        ablated: whether common sense only was required; then tasks without an ablation are not missed.

    Raises:
        BadInput: there is no row, or pass@k cannot be estimated for some prompt.
    """
    failed: dict[str, Counter[str]] = defaultdict(Counter)
    judged: Counter[str] = Counter()

    def results() -> Iterator[tuple[str, int, bool]]:
        for row in rows:
            judged[row["task"]] += 1
            if (why := row["failure"]) is not None:
                failed[why["class"]][why["kind"]] += 1
            yield row["task"], row["prompt"], row["passed"]

    scored = {score.task: score for score in score_by_prompt(results())}
    scope = scope or Scope(judged)
    if not judged:
        raise BadInput(f"0 of {how_many(scope.total)} judged, so there is nothing to count")
    tasks = tuple(scored[name] for name in dict.fromkeys([*suite.tasks, *scored]) if name in scored)
    try:
        estimates = tuple(overall(tasks, tries) for tries in k)
    except ValueError as error:
        fewest = min(prompt.n for task in tasks for prompt in task.prompts)
        raise BadInput(f"{visible(str(error))}; choose k from 1 to {fewest}") from None
    expected = [n for n, task in suite.tasks.items() if task.ablation is not None or not ablated]
    missing = _missing([name for name in expected if name not in scored], scope)
    return Summary(tuple(k), tasks, estimates, _failures(failed, judged.total()), scope, missing, ablated)


def _missing(tasks: Sequence[str], scope: Scope) -> Missing:
    selected = [task for task in tasks if scope.selects(task)]
    return Missing(
        no_completions=tuple(task for task in selected if not scope.completions.get(task)),
        not_judged=tuple(task for task in selected if scope.completions.get(task)),
        not_selected=tuple(task for task in tasks if not scope.selects(task)),
    )


def _failures(failed: Mapping[str, Counter[str]], n: int) -> tuple[Failures, ...]:
    def of_class(name: str) -> Failures:
        counts = failed.get(name, Counter())
        known = ALWAYS_SHOWN.get(name, ())
        others = sorted(counts.keys() - set(known), key=lambda kind: (-counts[kind], kind))
        kinds = tuple(Failures(kind, counts[kind], counts[kind] / n) for kind in [*known, *others])
        return Failures(name, counts.total(), counts.total() / n, kinds)

    return tuple(of_class(name) for name in [*CLASSES, *sorted(failed.keys() - set(CLASSES))])


# --- for people


def render(summary: Summary, *, title: str) -> RenderableType:
    """The tables of an evaluation.

    Args:
        summary: what they show.
        title: what was judged.
    """
    head = Text(visible(title) + by_hand(summary.scope.models), style="bold")
    if summary.ablated:
        head.append(" (ablation: only common sense was required)", style="not bold")
    n, failed = _judged(summary.prompts), sum(each.count for each in summary.failures)
    parts: list[RenderableType] = [head]
    if n < (total := summary.scope.total):
        parts.append(Text(f"{n:,} of {how_many(total)} judged", style="yellow"))
    elif n > total:
        parts.append(Text(f"{how_many(n)} judged, but only {total:,} there now", style="yellow"))
    parts += [Text(), _TaskTable(summary), Text(), *_overall(summary), *_missed(summary.missing)]
    if failed:
        told = f"{failed:,} of {how_many(n)} failed ({failed / n:.1%}); shares are of all completions:"
        tables = Columns([_failure_table(each) for each in summary.failures], padding=(1, 3))
        parts += [Text(), Text(told), Text(), tables]
    return Group(*parts)


def _missed(missing: Missing) -> Iterator[Text]:
    for reason, tasks in [
        ("no completions of", missing.no_completions),
        ("not judged yet:", missing.not_judged),
        ("not selected:", missing.not_selected),
    ]:
        if tasks:
            yield Text(f"{reason} {', '.join(map(visible, tasks))}", style="dim")


def _judged(prompts: Iterable[PromptScore]) -> int:
    return sum(prompt.n for prompt in prompts)


@dataclass(frozen=True)
class _TaskTable:
    """The scores of tasks; where there is no room for all columns, names of tasks stay whole."""

    summary: Summary

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Table]:
        boundless = options.update(max_width=10_000)
        tables = list(self._tables())
        fitting = (t for t in tables if console.measure(t, options=boundless).maximum <= options.max_width)
        yield next(fitting, tables[-1])

    def _tables(self) -> Iterator[Table]:
        """The table with fewer and fewer columns."""
        passes = [f"pass@{k}" for k in self.summary.k]
        yield self._table("completions", *passes, "worst prompt", "best prompt")
        yield self._table("completions", *passes, "worst\nprompt", "best\nprompt")
        yield self._table("completions", *passes)
        for count in range(len(passes), 0, -1):
            yield self._table(*passes[:count])

    def _table(self, *columns: str) -> Table:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
        table.add_column("task", overflow="fold")
        for name in columns:
            table.add_column(name, justify="right", no_wrap=True)
        first = self.summary.k[0]
        for task in self.summary.tasks:
            shares = {f"pass@{k}": task.pass_at(k).mean for k in self.summary.k}
            shares |= {"worst prompt": task.lowest(first), "best prompt": task.highest(first)}
            cells = {name: Text(f"{share:.2f}", _mood(share)) for name, share in shares.items()}
            cells["completions"] = Text(f"{_judged(task.prompts):,}")
            table.add_row(Text(visible(task.task)), *(cells[name.replace("\n", " ")] for name in columns))
        return table


def _mood(share: float) -> str:
    return "green" if share == 1 else "red" if share == 0 else ""


def _overall(summary: Summary) -> list[Text]:
    prompts = len(summary.prompts)
    lines = []
    for k, estimate in zip(summary.k, summary.overall, strict=True):
        line = Text.assemble(f"pass@{k} over all prompts: ", (f"{estimate.mean:.3f}", "bold"))
        if prompts > 1:
            line.append(f" (95% interval {estimate.low:.3f} to {estimate.high:.3f}, {prompts} prompts)")
        lines.append(line)
    return lines


def _failure_table(failures: Failures) -> Table:
    table = grid("left", "right", "right")
    for each in [failures, *failures.kinds]:
        name = visible(each.name) if each is failures else f"  {visible(each.name)}"
        style = "bold" if each is failures else "" if each.count else "dim"
        table.add_row(Text(name), f"{each.count:,}", f"{each.share:.1%}", style=style)
    return table


# --- for machines


def summary_data(summary: Summary) -> dict[str, Any]:
    """A summary as plain data."""
    estimates = zip(summary.k, summary.overall, strict=True)
    return {
        "models": sorted(model for model in summary.scope.models if model is not None),
        "judged": _judged(summary.prompts),
        "to_judge": summary.scope.total,
        **_counts(summary.prompts),
        **{f"pass@{k}": {"mean": e.mean, "low": e.low, "high": e.high} for k, e in estimates},
        "tasks": [_task_score_data(task, summary.k) for task in summary.tasks],
        "failures": [
            {**_failure_data(each, "class"), "kinds": [_failure_data(kind, "kind") for kind in each.kinds]}
            for each in summary.failures
        ],
        "missing": {name: list(tasks) for name, tasks in asdict(summary.missing).items()},
    }


def _task_score_data(task: TaskScore, ks: Sequence[int]) -> dict[str, Any]:
    spreads = {
        f"pass@{k}": {"mean": task.pass_at(k).mean, "lowest": task.lowest(k), "highest": task.highest(k)}
        for k in ks
    }
    prompts = [
        {"prompt": prompt.prompt, **_counts([prompt]), **{f"pass@{k}": prompt.pass_at(k) for k in ks}}
        for prompt in task.prompts
    ]
    return {"task": task.task, **_counts(task.prompts), **spreads, "prompts": prompts}


def _counts(prompts: Sequence[PromptScore]) -> dict[str, int]:
    return {"completions": _judged(prompts), "passed": sum(prompt.c for prompt in prompts)}


def _failure_data(failures: Failures, what: str) -> dict[str, Any]:
    return {what: failures.name, "count": failures.count, "share": failures.share}
