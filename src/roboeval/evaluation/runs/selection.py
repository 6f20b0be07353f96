"""Parses the selection of a part of a run: a task, a prompt or one completion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from codebotler.core.errors import UserError
from codebotler.core.terminal import visible
from roboeval.evaluation.runs.completions import CompletionKey
from roboeval.suites.load import Suite

if TYPE_CHECKING:
    from roboeval.evaluation.runs.results import Results


@dataclass(frozen=True)
class Selection:
    """A part of a run: a task, a prompt or one completion. If all fields are None, it is the whole run."""

    task: str | None = None
    prompt: int | None = None
    index: int | None = None

    def __str__(self) -> str:
        return "/".join(str(part) for part in (self.task, self.prompt, self.index) if part is not None)

    @property
    def key(self) -> CompletionKey:
        """Return the key of the selected completion. A single completion must be selected."""
        assert self.task is not None and self.prompt is not None and self.index is not None  # noqa: PT018 - a single condition
        return self.task, self.prompt, self.index

    def expect_judged(self, judged: Results) -> None:
        """Raise UserError if no completion in this part was judged."""
        wanted = self.task, self.prompt, self.index
        if not any(all(w in {None, h} for w, h in zip(wanted, key, strict=True)) for key in judged.places):
            what = f"completion {self}" if self.index is not None else f"completion of {self}"
            raise UserError(f"no {what if self.task else 'completion'} has been judged in this run")


def parse_selection(text: str | None, suite: Suite) -> Selection:
    """Parse TASK, TASK/PROMPT or TASK/PROMPT/INDEX. None selects the whole run."""
    if not text:
        return Selection()
    name, *numbers = text.removesuffix("/").split("/")
    if len(numbers) > 2 or not all(n.isascii() and n.isdecimal() and len(n) < 10 for n in numbers):  # noqa: PLR2004 - parts
        raise UserError(
            f'"{visible(text)}" is not a valid selection; write TASK, TASK/PROMPT or TASK/PROMPT/INDEX'
        )
    if name not in suite.tasks:
        name = next((task for task in suite.tasks if task.lower() == name.lower()), name)
    task = suite.task(name)
    selection = Selection(name, *map(int, numbers))
    if selection.prompt is not None and selection.prompt >= len(task.prompts):
        raise UserError(
            f"{selection} does not exist, because {name} has prompts 0 to {len(task.prompts) - 1}"
        )
    return selection


def names_completion(text: str) -> bool:
    """Whether a selection names one completion, because it has all three parts."""
    return text.removesuffix("/").count("/") == 2  # noqa: PLR2004 - two slashes separate three parts
