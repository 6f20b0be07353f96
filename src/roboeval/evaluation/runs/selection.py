"""Parses the selection of a part of a run: a task, a prompt or one completion."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.terminal import visible
from roboeval.evaluation.runs.completions import CompletionKey
from roboeval.suites.load import Suite

Selection: TypeAlias = tuple[str, *tuple[int, ...]]
"""The first parts of keys: a task, a prompt of it, or the key of a completion."""


def parse_selection(text: str, suite: Suite) -> Selection:
    """Parse TASK, TASK/PROMPT or TASK/PROMPT/INDEX."""
    name, *numbers = text.removesuffix("/").split("/")
    if len(numbers) > 2 or not all(n.isascii() and n.isdecimal() and len(n) < 10 for n in numbers):  # noqa: PLR2004 - parts
        raise UserError(
            f'"{visible(text)}" is not a valid selection; write TASK, TASK/PROMPT or TASK/PROMPT/INDEX'
        )
    if name not in suite.tasks:
        name = next((task for task in suite.tasks if task.lower() == name.lower()), name)
    task = suite.task(name)
    selection: Selection = (name, *map(int, numbers))
    if numbers and int(numbers[0]) >= len(task.prompts):
        known = f"{name} has prompts 0 to {len(task.prompts) - 1}"
        raise UserError(f"{name}/{'/'.join(numbers)} does not exist, because {known}")
    return selection


def expect_judged(selection: Selection, judged: Iterable[CompletionKey]) -> None:
    """Raise UserError if no completion in this part of a run was judged."""
    if not any(key[: len(selection)] == selection for key in judged):
        part = "/".join(map(str, selection))
        raise UserError(f"no completion of {part} has been judged in this run")


def names_completion(text: str) -> bool:
    """Whether a selection names one completion, because it has all three parts."""
    return text.removesuffix("/").count("/") == 2  # noqa: PLR2004 - two slashes separate three parts
