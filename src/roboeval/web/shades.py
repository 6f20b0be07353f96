"""Tables of shades: what stands in each cell, how dark it is, and where it leads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any
from urllib.parse import quote, urlencode

from codebotler.terminal import shortened
from roboeval.evaluation.tables import by_hand
from roboeval.suites.load import Suite
from roboeval.web.seen import Cell, Seen, Wanted
from roboeval.web.telling import order_of

STEPS = 10
NONE = "-"
MOST_NAME = 60
PASSED = Wanted(passed=True)


def percent(share: float) -> str:
    """A share in whole percent; what is little is not nothing, and what is nearly all is not all."""
    if 0 < share < 0.01:  # noqa: PLR2004 - a percent
        return "<1"
    return ">99" if 0.99 < share < 1 else f"{100 * share:.0f}"  # noqa: PLR2004 - all but a percent


def shade(share: float | None, *, bad: bool) -> str:
    """How a cell with a share looks.

    Args:
        share: from 0 to 1; None where there is none.
        bad: whether it is one of failures.
    """
    if share is None:
        return "waits"
    step = 0 if share == 0 else STEPS if share == 1 else max(1, min(STEPS - 1, round(share * STEPS)))
    return f"{'f' if bad else 's'}{step}"


def address(run: str) -> str:
    """Where the page of a run is."""
    return f"/runs/{quote(run, safe='', errors='replace')}"


def query_of(wanted: Wanted, evaluation: str | None) -> str:
    """What stands behind the address of a page for what somebody wants to see there."""
    given = {
        "evaluation": evaluation,
        "task": wanted.task,
        "prompt": wanted.prompt,
        "passed": None if wanted.passed is None else str(wanted.passed).lower(),
        "failure": wanted.failure_class,
        "kind": wanted.kind,
    }
    found = urlencode({name: value for name, value in given.items() if value is not None}, errors="replace")
    return f"?{found}" if found else ""


def columns(prompts: int, mean: str) -> list[dict[str, Any]]:
    """The columns of a run: the mean, and a prompt each."""
    numbers = [{"name": str(n), "told": f"prompt {n}"} for n in range(prompts)]
    return [{"name": mean, "told": "mean over the prompts"}, *numbers]


class Shades:
    """A run's part of a table of tasks by prompts.

    Args:
        seen: the run.
        suite: by which it was judged, if that is at hand.
        wanted: what is counted, and which cell is marked.
        evaluation: as the address is to name it.
    """

    def __init__(self, seen: Seen, suite: Suite | None, wanted: Wanted, evaluation: str | None) -> None:
        self._seen, self._evaluation = seen, evaluation
        filtered = wanted.passed is not None or wanted.failure_class is not None
        self._wanted, self._marked = (wanted if filtered else PASSED), wanted
        self._bad = self._wanted.passed is not True
        self.tasks: dict[str, dict[int, Cell]] = {}
        for cell in seen.cells(self._wanted, order_of(suite)):
            self.tasks.setdefault(cell.task, {})[cell.prompt] = cell
        self.prompts = 1 + max((prompt for cells in self.tasks.values() for prompt in cells), default=-1)

    def cells(self, task: str, prompts: int) -> list[dict[str, Any]]:
        """The cells of a task: the mean over its prompts, and those.

        Args:
            task: its name.
            prompts: how many cells to give; what there is not, is empty.
        """
        cells = self.tasks.get(task)
        if cells is None:
            return [{"text": "", "look": "none"} for _ in range(prompts + 1)]
        shares = [cell.share for cell in cells.values() if cell.share is not None]
        mean = sum(shares) / len(shares) if shares else None
        return [
            self._mean(task, mean),
            *(self._cell(cells[n]) if n in cells else {"text": "", "look": "none"} for n in range(prompts)),
        ]

    def _mean(self, task: str, mean: float | None) -> dict[str, Any]:
        here = self._marked.task == task and self._marked.prompt is None
        told = "nothing is judged yet" if mean is None else f"{percent(mean)} % {self._word}"
        look = f"mean {shade(mean, bad=self._bad)}"
        return self._linked(task, None, NONE if mean is None else percent(mean), look, told, here=here)

    def _cell(self, cell: Cell) -> dict[str, Any]:
        here = (self._marked.task, self._marked.prompt) == (cell.task, cell.prompt)
        if cell.share is None:
            told = f"{cell.written} written, none judged yet"
            return self._linked(cell.task, cell.prompt, f"({cell.written})", "waits", told, here=here)
        told = f"{percent(cell.share)} % {self._word}, {cell.counted} of {cell.judged}"
        text, look = percent(cell.share), shade(cell.share, bad=self._bad)
        return self._linked(cell.task, cell.prompt, text, look, told, here=here)

    @property
    def _word(self) -> str:
        wanted = self._wanted
        by = shortened(wanted.kind or wanted.failure_class or "anything", MOST_NAME)
        return "passed" if wanted.passed else f"failed by {by}"

    def _linked(
        self, task: str, prompt: int | None, text: str, look: str, told: str, *, here: bool
    ) -> dict[str, Any]:
        place = Wanted(task, prompt, self._marked.passed, self._marked.failure_class, self._marked.kind)
        name = shortened(task, MOST_NAME)
        which = name if prompt is None else f"{name}, prompt {prompt}"
        return {
            "text": text,
            "look": f"{look} here" if here else look,
            "told": f"{which}: {told}",
            "href": address(self._seen.name) + query_of(place, self._evaluation) + "#completions",
            "here": here,
            "at": [task.encode(errors="replace").decode(), prompt],
        }


def kinds_table(
    runs: Sequence[Seen], tried: Callable[[Seen], str | None]
) -> tuple[list[Mapping[str, Any]], list[Mapping[str, Any]]]:
    """Kinds of failures by run: of all that was judged, how much failed by each.

    Args:
        runs: side by side.
        tried: gives the evaluation of a run as its address is to name it.

    Returns:
        groups and rows of a table of shades.
    """
    kinds = dict.fromkeys(kind for seen in runs for kind in seen.kinds)
    ordered = sorted(
        kinds, key=lambda kind: -max(seen.kinds.get(kind, 0) / len(seen.judged) for seen in runs)
    )
    rows: list[Mapping[str, Any]] = []
    for failure_class, kind in ordered:
        cells = []
        for seen in runs:
            count = seen.kinds.get((failure_class, kind), 0)
            share = count / len(seen.judged)
            wanted = Wanted(failure_class=failure_class, kind=kind)
            failed = f"{percent(share)} % failed by {shortened(kind, MOST_NAME)}, {count:,}"
            told = f"{shortened(seen.name, MOST_NAME)}: {failed}"
            href = address(seen.name) + query_of(wanted, tried(seen)) + "#completions"
            look = shade(share, bad=True)
            cells.append(
                {"text": percent(share), "look": look, "told": told, "href": href if count else None}
            )
        rows.append(
            {"name": f"{shortened(failure_class, MOST_NAME)}: {shortened(kind, MOST_NAME)}", "cells": cells}
        )
    columns = [
        {"name": shortened(seen.name, MOST_NAME), "told": title_of(seen), "href": address(seen.name)}
        for seen in runs
    ]
    return [{"name": "", "columns": columns}], rows


def title_of(seen: Seen) -> str:
    """Who wrote a run."""
    models = [model for model in seen.models if model is not None]
    if not models:
        return "model not recorded"
    return shortened(", ".join(models), 200) + by_hand(models)
