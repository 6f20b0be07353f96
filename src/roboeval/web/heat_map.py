"""Heat maps: what stands in each cell, its shade, and where it leads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any
from urllib.parse import quote

from codebotler.terminal import shortened
from roboeval.analysis.summary import Failures
from roboeval.analysis.tasks import by_hand
from roboeval.evaluation.failures import label_of
from roboeval.web.snapshot import Cell, Filter, Snapshot

STEPS = 10
NONE = "-"
MOST_NAME, MOST_MODELS = 60, 200
PASSED = Filter(passed=True)
EMPTY = {"text": "", "shade": "none"}


def percent(share: float) -> str:
    """A share in whole percent; what is little is not nothing, and what is nearly all is not all."""
    if 0 < share < 0.01:  # noqa: PLR2004 - a percent
        return "<1"
    return ">99" if 0.99 < share < 1 else f"{100 * share:.0f}"  # noqa: PLR2004 - all but a percent


def shade(share: float | None, *, bad: bool) -> str:
    """The CSS class of a cell.

    Args:
        share: from 0 to 1; None where there is none.
        bad: whether it is a share of failures.
    """
    if share is None:
        return "waits"
    step = 0 if share == 0 else STEPS if share == 1 else max(1, min(STEPS - 1, round(share * STEPS)))
    return f"{'f' if bad else 's'}{step}"


def address(run: str) -> str:
    """The address of a run's page."""
    return f"/runs/{quote(run, safe='', errors='replace')}"


def models_of(run: Snapshot) -> str:
    """The models that wrote a run's completions, as text."""
    if not run.models:
        return "model not recorded"
    return shortened(", ".join(run.models), MOST_MODELS) + by_hand(run.models)


def failure_text(filter: Filter) -> str | None:  # noqa: A002
    """The kind or class of failures that a filter means, as text; None if it means others, too."""
    if filter.kind is not None:
        return shortened(filter.kind, MOST_NAME)
    return None if filter.failure is None else f"a {shortened(label_of(filter.failure), MOST_NAME)}"


def columns(prompts: int) -> list[dict[str, Any]]:
    """The columns of a run: the mean, and one for each prompt."""
    numbers = [{"name": str(n), "title": f"prompt {n}"} for n in range(prompts)]
    return [{"name": "all", "title": "mean over the prompts"}, *numbers]


class TaskCells:
    """The part of a run in a heat map of tasks by prompts.

    Args:
        run: as it was last read.
        filter: what is counted, and which cell is marked.
        evaluation: as addresses are to name it.
    """

    def __init__(self, run: Snapshot, filter: Filter, evaluation: str | None) -> None:  # noqa: A002
        self._run, self._filter, self._evaluation = run, filter, evaluation
        self._counted = PASSED if filter.verdict == Filter() else filter
        self.tasks: dict[str, dict[int, Cell]] = {}
        for cell in run.cells(self._counted):
            self.tasks.setdefault(cell.task, {})[cell.prompt] = cell
        self.prompts = 1 + max((prompt for cells in self.tasks.values() for prompt in cells), default=-1)

    def row(self, task: str) -> list[dict[str, Any]]:
        """The cells of a task: the mean over its prompts, and one for each prompt."""
        cells = self.tasks.get(task)
        if cells is None:
            return [EMPTY] * (self.prompts + 1)
        shares = [cell.share for cell in cells.values() if cell.share is not None]
        mean = sum(shares) / len(shares) if shares else None
        each = (self._cell(cells[n]) if n in cells else EMPTY for n in range(self.prompts))
        return [self._mean(task, mean), *each]

    def _mean(self, task: str, mean: float | None) -> dict[str, Any]:
        look = f"mean {shade(mean, bad=not self._counted.passed)}"
        if mean is None:
            return self._linked(task, None, NONE, look, "nothing is judged yet")
        return self._linked(task, None, percent(mean), look, f"{percent(mean)} % {self._verb}")

    def _cell(self, cell: Cell) -> dict[str, Any]:
        if cell.share is None:
            title = f"{cell.written} written, none judged yet"
            return self._linked(cell.task, cell.prompt, f"({cell.written})", "waits", title)
        text = percent(cell.share)
        title = f"{text} % {self._verb}, {cell.counted} of {cell.judged}"
        return self._linked(
            cell.task, cell.prompt, text, shade(cell.share, bad=not self._counted.passed), title
        )

    @property
    def _verb(self) -> str:
        by = failure_text(self._counted)
        return "failed with " + by if by is not None else "passed" if self._counted.passed else "failed"

    def _linked(self, task: str, prompt: int | None, text: str, look: str, title: str) -> dict[str, Any]:
        here = (self._filter.task, self._filter.prompt) == (task, prompt)
        name = shortened(task, MOST_NAME)
        which = name if prompt is None else f"{name}, prompt {prompt}"
        query = replace(self._filter, task=task, prompt=prompt).query(self._evaluation)
        return {
            "text": text,
            "shade": f"{look} here" if here else look,
            "title": f"{which}: {title}",
            "href": f"{address(self._run.name)}{query}#completions",
            "here": here,
            "at": [task, prompt],
        }


def failure_rows(runs: Sequence[Snapshot]) -> list[Mapping[str, Any]]:
    """Kinds of failures by run: how much of all that was judged failed by each; the most frequent first.

    Args:
        runs: of which something was judged.
    """
    found = [{(of.name, kind.name): kind for of in run.failures for kind in of.kinds} for run in runs]
    most: dict[tuple[str, str], float] = {}
    for kinds in found:
        for key, kind in kinds.items():
            most[key] = max(kind.share, most.get(key, 0.0))
    return [
        {
            "name": f"{shortened(label_of(key[0]), MOST_NAME)}: {shortened(key[1], MOST_NAME)}",
            "cells": [
                _failure_cell(run, Filter(failure=key[0], kind=key[1]), kinds.get(key))
                for run, kinds in zip(runs, found, strict=True)
            ],
        }
        for key in sorted(most, key=lambda key: -most[key])
    ]


def _failure_cell(run: Snapshot, filter: Filter, kind: Failures | None) -> dict[str, Any]:  # noqa: A002
    count, share = (0, 0.0) if kind is None else (kind.count, kind.share)
    text = percent(share)
    return {
        "text": text,
        "shade": shade(share, bad=True),
        "title": f"{shortened(run.name, MOST_NAME)}: {text} % failed with {failure_text(filter)}, {count:,}",
        "href": f"{address(run.name)}{filter.query(None)}#completions" if count else None,
    }
