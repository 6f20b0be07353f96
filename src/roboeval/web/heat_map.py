"""Heat maps: the text, shade and link of each cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any
from urllib.parse import quote

from codebotler.core.terminal import shortened
from roboeval.analysis.metrics import mean_of
from roboeval.analysis.summary import Failures
from roboeval.evaluation.failures import NO_PROGRAM_CLASS, ending_of, plural_of
from roboeval.evaluation.runs.completions import recorded_suffix
from roboeval.web.snapshot import CompletionFilter, Snapshot

STEPS = 10
NONE = "-"
MOST_NAME, MOST_MODELS = 60, 200
EMPTY = {"text": "", "shade": "none"}


def percent(share: float) -> str:
    """Format a share in whole percent; "<1" and ">99" avoid rounding to 0 and 100."""
    if 0 < share < 0.01:  # noqa: PLR2004 - one percent
        return "<1"
    return ">99" if 0.99 < share < 1 else f"{100 * share:.0f}"  # noqa: PLR2004 - 99 percent


def shade(share: float | None, *, bad: bool) -> str:
    """The CSS class of a cell with a share from 0 to 1, or None without one."""
    if share is None:
        return "waits"
    step = 0 if share == 0 else STEPS if share == 1 else max(1, min(STEPS - 1, round(share * STEPS)))
    return f"{'f' if bad else 's'}{step}"


def address(run: str) -> str:
    """The address of a run's page."""
    return f"/runs/{quote(run, safe='', errors='replace')}"


def models_of(run: Snapshot) -> str:
    """Format the models of a run."""
    if not run.models:
        return "model not recorded"
    return shortened(", ".join(run.models), MOST_MODELS) + recorded_suffix(run.models)


def failure_text(chosen: CompletionFilter) -> str | None:
    """Describe the failure that a filter selects, such as `in NameError`; None if it selects no failure."""
    kind = None if chosen.failure_kind is None else shortened(chosen.failure_kind, MOST_NAME)
    if chosen.failure_class == NO_PROGRAM_CLASS:
        return ending_of(NO_PROGRAM_CLASS) + ("" if kind is None else f" ({kind})")
    if kind is not None:
        return f"in {kind}"
    return None if chosen.failure_class is None else shortened(ending_of(chosen.failure_class), MOST_NAME)


class TaskCells:
    """The cells of a run in a heat map of tasks by prompts; the selected cell is marked."""

    def __init__(self, run: Snapshot, chosen: CompletionFilter, evaluation: str | None = None) -> None:
        self._run, self._filter, self._evaluation = run, chosen, evaluation
        counted = CompletionFilter(passed=True) if chosen.verdict == CompletionFilter() else chosen
        self._bad = not counted.passed
        by = failure_text(counted)
        self._verb = "passed" if counted.passed else "failed" if by is None else f"ended {by}"
        self.tasks: dict[str, dict[int, dict[str, Any]]] = {}
        for prompt in run.prompts(counted):
            self.tasks.setdefault(prompt["task"], {})[prompt["prompt"]] = prompt
        self._prompts = 1 + max((prompt for of in self.tasks.values() for prompt in of), default=-1)

    @property
    def columns(self) -> list[dict[str, Any]]:
        """A column for the mean and one for each prompt."""
        numbers = [{"name": f"prompt {n}", "title": f"prompt {n} of each task"} for n in range(self._prompts)]
        return [{"name": "mean", "title": "mean over the prompts"}, *numbers]

    def row(self, task: str) -> list[dict[str, Any]]:
        """The cells of a task."""
        prompts = self.tasks.get(task)
        if prompts is None:
            return [{**EMPTY, "text": "no completions", "span": 1 + self._prompts}]
        shares = [each["share"] for each in prompts.values() if each["share"] is not None]
        mean = self._mean(task, mean_of([shares]) if shares else None)
        return [mean, *(self._cell(prompts[n]) if n in prompts else EMPTY for n in range(self._prompts))]

    def _mean(self, task: str, mean: float | None) -> dict[str, Any]:
        text = NONE if mean is None else percent(mean)
        title = "not judged yet" if mean is None else f"{text}% {self._verb}"
        return self._linked(task, None, text, f"mean {shade(mean, bad=self._bad)}", title)

    def _cell(self, of: Mapping[str, Any]) -> dict[str, Any]:
        share = of["share"]
        text = f"({of['written']})" if share is None else percent(share)
        title = f"{text}% {self._verb}, {of['counted']} of {of['judged']}"
        if share is None:
            title = f"{of['written']} written, not judged yet"
        return self._linked(of["task"], of["prompt"], text, shade(share, bad=self._bad), title)

    def _linked(self, task: str, prompt: int | None, text: str, look: str, title: str) -> dict[str, Any]:
        here = (self._filter.task, self._filter.prompt) == (task, prompt)
        which = shortened(task, MOST_NAME) + ("" if prompt is None else f", prompt {prompt}")
        query = replace(self._filter, task=task, prompt=prompt).query(self._evaluation)
        return {
            "text": text,
            "shade": f"{look} here" if here else look,
            "title": f"{which}: {title}",
            "href": f"{address(self._run.name)}{query}#completions",
            "here": here,
            "at": [task, prompt],
        }


def failure_rows(runs: Sequence[Snapshot]) -> list[dict[str, Any]]:
    """Rows of failures by run: each class with its kinds, the most frequent first."""
    found = [{(of.name, kind.name): kind for of in run.failures for kind in of.kinds} for run in runs]
    most: dict[tuple[str, str], float] = {}
    for kinds in found:
        most |= {key: max(kind.share, most.get(key, 0.0)) for key, kind in kinds.items()}
    classes = [{of.name: of for of in run.failures} for run in runs]
    largest: dict[str, float] = {}
    for known in classes:
        largest |= {name: max(of.share, largest.get(name, 0.0)) for name, of in known.items()}
    rows = []
    for name in sorted(largest, key=lambda name: -largest[name]):
        totals = [known.get(name) for known in classes]
        rows.append(
            _failure_row(plural_of(name), runs, CompletionFilter(failure_class=name), totals, "of-all")
        )
        for kind in sorted((k for of, k in most if of == name), key=lambda kind: -most[name, kind]):
            chosen = CompletionFilter(failure_class=name, failure_kind=kind)
            rows.append(
                _failure_row(kind, runs, chosen, [kinds.get((name, kind)) for kinds in found], "of-class")
            )
    return rows


def _failure_row(
    name: str,
    runs: Sequence[Snapshot],
    chosen: CompletionFilter,
    failures: Sequence[Failures | None],
    look: str,
) -> dict[str, Any]:
    cells = [_failure_cell(run, chosen, one) for run, one in zip(runs, failures, strict=True)]
    return {"name": shortened(name, MOST_NAME), "look": look, "cells": cells}


def _failure_cell(run: Snapshot, chosen: CompletionFilter, kind: Failures | None) -> dict[str, Any]:
    count, share = (0, 0.0) if kind is None else (kind.count, kind.share)
    text = percent(share)
    return {
        "text": text,
        "shade": shade(share, bad=True),
        "title": f"{shortened(run.name, MOST_NAME)}: {text}% ended {failure_text(chosen)}, {count:,}",
        "href": f"{address(run.name)}{chosen.query(None)}#completions" if count else None,
    }
