"""A part of a run: a task, a prompt or one completion."""

from __future__ import annotations

from dataclasses import dataclass

from codebotler.badinput import BadInput
from codebotler.terminal import visible
from roboeval.evaluation.runs.results import Results
from roboeval.suites.load import Suite


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

    def expect_judged(self, results: Results) -> None:
        """Refuse a part of which nothing was judged.

        Raises:
            BadInput: so it is.
        """
        wanted = self.task, self.prompt, self.index
        if not any(all(w in {None, h} for w, h in zip(wanted, key, strict=True)) for key in results.places):
            what = f"completion {self}" if self.index is not None else f"completion of {self}"
            raise BadInput(f"no {what if self.task else 'completion'} has been judged in this run")


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
