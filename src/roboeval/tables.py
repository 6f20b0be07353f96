"""What a person reads after an evaluation: how often programs succeed and how they fail, counted."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeAlias

from rich import box
from rich.columns import Columns
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from codebotler.badinput import BadInput
from roboeval.evaluation import Scope
from roboeval.metrics import Estimate, PromptScore, TaskScore, overall, score_by_prompt
from roboeval.records import Completion, Key
from roboeval.suite import Suite
from roboeval.taxonomy import CATEGORIES, CLASSES, PYTHON, PYTHON_KINDS, ROBOT, ROBOT_KINDS, TASK

Row: TypeAlias = Mapping[str, Any]

NOT_RECORDED = "instruction not recorded"
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
    rows: Iterable[Row],
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
        raise BadInput(f"0 of {scope.total:,} completions judged, so there is nothing to count")
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
    if n != summary.scope.total:
        parts.append(Text(f"{n:,} of {summary.scope.total:,} completions judged", style="yellow"))
    parts += [Text(), _task_table(summary), Text(), *_overall(summary), *_missed(summary.missing)]
    if failed:
        told = f"{failed:,} of {n:,} completions failed ({failed / n:.1%}); shares are of all completions:"
        tables = Columns([_failure_table(each) for each in summary.failures], padding=(1, 3))
        parts += [Text(), Text(told), Text(), tables]
    return Group(*parts)


def by_hand(models: Collection[str | None]) -> str:
    """What a title adds if recorded programs are among those of some models, which stand for no real one."""
    recorded = [model for model in models if model is not None and model.startswith("recorded:")]
    if not recorded:
        return ""
    return f" ({'' if len(recorded) == len(models) else 'some '}programs written by hand)"


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


def _task_table(summary: Summary) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column("task", overflow="fold")
    passes = [f"pass@{k}" for k in summary.k]
    for name in ["completions", *passes, "worst prompt", "best prompt"]:
        table.add_column(name, justify="right", no_wrap=True)
    for task in summary.tasks:
        means = [task.pass_at(k).mean for k in summary.k]
        shares = [*means, task.lowest(summary.k[0]), task.highest(summary.k[0])]
        cells = [Text(f"{share:.2f}", _mood(share)) for share in shares]
        table.add_row(Text(visible(task.task)), f"{_judged(task.prompts):,}", *cells)
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


# --- a part of a run


@dataclass(frozen=True)
class Selection:
    """A part of a run: all of it, a task, a prompt or one completion; what is None is not narrowed.

    Args:
        task: the task's name.
        prompt: counted from 0.
        index: counted from 0.
    """

    task: str | None = None
    prompt: int | None = None
    index: int | None = None

    def __str__(self) -> str:
        return "/".join(str(part) for part in (self.task, self.prompt, self.index) if part is not None)

    def rows(self, rows: Iterable[Row]) -> list[Row]:
        """The rows that it selects.

        Raises:
            BadInput: there is none.
        """
        wanted = self.task, self.prompt, self.index
        found = [
            r for r in rows if all(want in {None, has} for want, has in zip(wanted, key_of(r), strict=True))
        ]
        if not found:
            what = f"completion {self}" if self.index is not None else f"completion of {self}"
            raise BadInput(f"no {what if self.task else 'completion'} has been judged in this run")
        return found


def parse_selection(text: str | None, suite: Suite) -> Selection:
    """Read what a user wants to see: nothing for the whole run, TASK, TASK/PROMPT or TASK/PROMPT/INDEX.

    Raises:
        BadInput: it is none of these, or the suite has no such task or prompt.
    """
    if not text:
        return Selection()
    name, *numbers = text.removesuffix("/").split("/")
    if len(numbers) > 2 or not all(n.isascii() and n.isdecimal() and len(n) < 10 for n in numbers):  # noqa: PLR2004
        raise BadInput(f'"{visible(text)}" selects nothing; write TASK, TASK/PROMPT or TASK/PROMPT/INDEX')
    if name not in suite.tasks:
        name = next((task for task in suite.tasks if task.lower() == name.lower()), name)
    task = suite.task(name)
    selection = Selection(name, *map(int, numbers))
    if selection.prompt is not None and selection.prompt >= len(task.prompts):
        raise BadInput(f"{name} has prompts 0 to {len(task.prompts) - 1}, so {selection} selects nothing")
    return selection


# --- one task, prompt by prompt


def task_data(
    rows: Iterable[Row], completions: Iterable[Completion], suite: Suite, task: str
) -> dict[str, Any]:
    """A task, prompt by prompt: how many completions passed, and how the others failed.

    Args:
        rows: of the evaluation.
        completions: that were judged.
        suite: by which they were judged.
        task: its name.

    Raises:
        BadInput: the task has no row.
    """
    written = of_task(completions, task)
    by_prompt: dict[int, list[Row]] = defaultdict(list)
    for row in Selection(task).rows(rows):
        by_prompt[row["prompt"]].append(row)
    return {
        "task": task,
        "summary": suite.tasks[task].summary if task in suite.tasks else None,
        "prompts": [
            {**prompt_head(prompt, of_prompt, written), "failures": _failure_kinds(of_prompt)}
            for prompt, of_prompt in sorted(by_prompt.items())
        ],
    }


def of_task(completions: Iterable[Completion], task: str) -> dict[Key, Completion]:
    """A task's completions by key."""
    return {completion.key: completion for completion in completions if completion.task == task}


def key_of(row: Row) -> Key:
    """What no other row of an evaluation shares."""
    return row["task"], row["prompt"], row["index"]


def prompt_head(prompt: int, rows: Sequence[Row], written: Mapping[Key, Completion]) -> dict[str, Any]:
    """What a prompt told the model, and how many of its completions passed."""
    passed = sum(row["passed"] for row in rows)
    those = [written[key_of(row)] for row in rows if key_of(row) in written]
    return {
        "prompt": prompt,
        "instructions": list(dict.fromkeys(c.instruction for c in those if c.instruction is not None)),
        "models": list(dict.fromkeys(c.model for c in those if c.model is not None)),
        "completions": len(rows),
        "passed": passed,
        "pass@1": passed / len(rows),
    }


def _failure_kinds(rows: Sequence[Row]) -> list[dict[str, Any]]:
    counts: Counter[tuple[str, str]] = Counter()
    examples: dict[tuple[str, str], int] = {}
    for row in rows:
        if (why := row["failure"]) is not None:
            kind = why["class"], why["kind"]
            counts[kind] += 1
            examples.setdefault(kind, row["index"])
    return [
        {"class": kind[0], "kind": kind[1], "count": count, "example": examples[kind]}
        for kind, count in counts.most_common()
    ]


def task_view(rows: Iterable[Row], completions: Iterable[Completion], suite: Suite, task: str) -> Group:
    """What `task_data` says, for a person."""
    data = task_data(rows, completions, suite, task)
    models = {model for prompt in data["prompts"] for model in prompt["models"]}
    parts: list[RenderableType] = [Text(visible(task) + by_hand(models), style="bold")]
    if data["summary"]:
        parts.append(Text(visible(data["summary"])))
    for prompt in data["prompts"]:
        parts += [Text(), *prompt_lines(task, prompt)]
        table = grid("right", "left", "left")
        for failure in prompt["failures"]:
            example = Text(f"such as {visible(task)}/{prompt['prompt']}/{failure['example']}", "dim")
            table.add_row(f"  {failure['count']:,}", kind_of(failure), example)
        parts.append(table)
    return Group(*parts)


def prompt_lines(task: str, prompt: Mapping[str, Any]) -> list[Text]:
    """What `prompt_head` says, for a person."""
    score = f"{prompt['passed']:,} of {prompt['completions']:,} passed (pass@1 {prompt['pass@1']:.2f})"
    head = Text.assemble((f"{visible(task)}/{prompt['prompt']}", "bold"), "  ", score)
    return [head, *(Text(visible(text), "italic") for text in prompt["instructions"] or [NOT_RECORDED])]


def kind_of(failure: Mapping[str, Any]) -> Text:
    """A failure's class and kind."""
    return Text.assemble((f"{visible(failure['class'])}: {visible(failure['kind'])}", "red"))


# --- text that may come from a model


def visible(text: str) -> str:
    """A text with whatever a terminal would obey or hide, such as ESC, written out as an escape."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shortened(text: str, most: int = 500) -> str:
    """A text made visible, without what is too much to read."""
    left = len(text) - most
    return visible(text) if left <= 0 else f"{visible(text[:most])}... {left:,} more characters"


def grid(*justify: Literal["left", "right"]) -> Table:
    """A table without lines; numbers stand on the right and are never broken."""
    table = Table.grid(padding=(0, 2, 0, 0))
    for side in justify:
        table.add_column(justify=side, no_wrap=side == "right", overflow="fold")
    return table
