"""A part of a run as tables: one task, prompt by prompt, and what all tables are made of."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from rich.console import Group, RenderableType
from rich.text import Text

from codebotler.badinput import BadInput
from codebotler.storyboard import grid
from codebotler.terminal import visible
from roboeval.evaluation.completions import Completion, Key
from roboeval.suites.load import Suite

RowData: TypeAlias = Mapping[str, Any]
"""A row of an evaluation, or a part of one, as JSON has it."""

NOT_RECORDED = "instruction not recorded"
ALL_GONE = "the programs that were judged no longer stand in this run"


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

    def rows(self, rows: Iterable[RowData]) -> list[RowData]:
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
    if len(numbers) > 2 or not all(n.isascii() and n.isdecimal() and len(n) < 10 for n in numbers):  # noqa: PLR2004 - parts
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
    rows: Iterable[RowData], completions: Iterable[Completion], suite: Suite, task: str
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
    by_prompt: dict[int, list[RowData]] = defaultdict(list)
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


def key_of(row: RowData) -> Key:
    """What no other row of an evaluation shares."""
    return row["task"], row["prompt"], row["index"]


def prompt_head(prompt: int, rows: Sequence[RowData], written: Mapping[Key, Completion]) -> dict[str, Any]:
    """What a prompt told the model, and how many of its completions passed."""
    passed = sum(row["passed"] for row in rows)
    those = [written[key_of(row)] for row in rows if key_of(row) in written]
    return {
        "prompt": prompt,
        "instructions": list(dict.fromkeys(c.instruction for c in those if c.instruction is not None)),
        "models": list(dict.fromkeys(c.model for c in those if c.model is not None)),
        "completions": len(rows),
        "gone": len(rows) - len(those),
        "passed": passed,
        "pass@1": passed / len(rows),
    }


def _failure_kinds(rows: Sequence[RowData]) -> list[dict[str, Any]]:
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


def task_view(rows: Iterable[RowData], completions: Iterable[Completion], suite: Suite, task: str) -> Group:
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
    if prompt["gone"] == prompt["completions"]:
        return [head, Text(ALL_GONE, "yellow")]
    return [head, *(Text(visible(text), "italic") for text in prompt["instructions"] or [NOT_RECORDED])]


def kind_of(failure: Mapping[str, Any]) -> Text:
    """A failure's class and kind."""
    return Text.assemble((f"{visible(failure['class'])}: {visible(failure['kind'])}", "red"))


def by_hand(models: Collection[str | None]) -> str:
    """What a title adds if recorded programs are among those of some models, which stand for no real one."""
    recorded = [model for model in models if model is not None and model.startswith("recorded:")]
    if not recorded:
        return ""
    return f" ({'' if len(recorded) == len(models) else 'some '}programs written by hand)"
