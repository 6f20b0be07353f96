"""Computes the text, shade and link of each cell of a heat map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any
from urllib.parse import quote

from codebotler.core.terminal import shortened
from roboeval.analysis.counting.summary import Failures
from roboeval.analysis.metrics import mean_of, percent
from roboeval.evaluation.judging.failures import NO_PROGRAM_CLASS, label_of, plural_of
from roboeval.evaluation.runs.completions import recorded_suffix
from roboeval.web.snapshot import CompletionFilter, Snapshot

SHADE_STEPS = 10
MISSING = "-"
MAX_NAME, MAX_MODELS_TEXT = 60, 200
EMPTY_CELL = {"text": "", "shade": "none"}


def shade(share: float | None, *, bad: bool) -> str:
    """Return the CSS class for a share: `s7` for 0.7, `f7` if high shares are `bad`, and `waits` for None."""
    if share is None:
        return "waits"
    step = round(share * SHADE_STEPS)
    if 0 < share < 1:
        step = max(1, min(SHADE_STEPS - 1, step))
    return f"{'f' if bad else 's'}{step}"


def run_address(run: str) -> str:
    """Return the path in the URL of a run's page, such as `/runs/my-run`."""
    return f"/runs/{quote(run, safe='', errors='replace')}"


def models_of(run: Snapshot) -> str:
    """Return the names of a run's models as a text, shortened if it is long, or `model not recorded`."""
    if not run.models:
        return "model not recorded"
    return shortened(", ".join(run.models), MAX_MODELS_TEXT) + recorded_suffix(run.models)


def failure_text(chosen: CompletionFilter) -> str | None:
    """Describe the failure that a filter selects, e.g. `in NameError`, or return None if it selects none."""
    kind = None if chosen.failure_kind is None else shortened(chosen.failure_kind, MAX_NAME)
    if chosen.failure_class == NO_PROGRAM_CLASS:
        return plural_of(NO_PROGRAM_CLASS) + ("" if kind is None else f" ({kind})")
    if kind is not None:
        return f"in {kind}"
    name = chosen.failure_class
    return None if name is None else shortened(f"in a {label_of(name)}", MAX_NAME)


def verb_of(chosen: CompletionFilter) -> str:
    """Return what completions selected by a filter did, such as `passed` or `ended in NameError`."""
    if (by := failure_text(chosen)) is not None:
        return f"ended {by}"
    return "failed" if chosen.passed is False else "passed"


class TaskCells:
    """Computes a run's cells in a heat map of tasks (rows) by prompts (columns). Marks the selected cell."""

    def __init__(self, run: Snapshot, chosen: CompletionFilter, evaluation: str | None = None) -> None:
        self._run, self._filter, self._evaluation = run, chosen, evaluation
        counted = CompletionFilter(passed=True) if chosen.without_prompt == CompletionFilter() else chosen
        self._bad = not counted.passed
        self._verb = verb_of(counted)
        self.tasks: dict[str, dict[int, dict[str, Any]]] = {}
        for prompt in run.prompts(counted):
            self.tasks.setdefault(prompt["task"], {})[prompt["prompt"]] = prompt
        self._prompts = 1 + max((prompt for prompts in self.tasks.values() for prompt in prompts), default=-1)

    @property
    def columns(self) -> list[dict[str, Any]]:
        """The columns of the run: one for the mean of a task, and one for each prompt."""
        numbers = [{"name": f"prompt {n}", "title": f"prompt {n} of each task"} for n in range(self._prompts)]
        return [{"name": "mean", "title": "mean over the prompts"}, *numbers]

    def row(self, task: str) -> list[dict[str, Any]]:
        """Return the cells of a task: its mean and one for each prompt, or one cell without completions."""
        prompts = self.tasks.get(task)
        if prompts is None:
            return [{**EMPTY_CELL, "text": "no completions", "span": 1 + self._prompts}]
        shares = [each["share"] for each in prompts.values() if each["share"] is not None]
        mean = self._mean(task, mean_of([shares]) if shares else None)
        return [mean, *(self._cell(prompts[n]) if n in prompts else EMPTY_CELL for n in range(self._prompts))]

    def _mean(self, task: str, mean: float | None) -> dict[str, Any]:
        text = MISSING if mean is None else percent(mean)
        title = "not judged yet" if mean is None else f"{text}% {self._verb}"
        return self._linked(task, None, text, f"mean {shade(mean, bad=self._bad)}", title)

    def _cell(self, prompt: Mapping[str, Any]) -> dict[str, Any]:
        share = prompt["share"]
        text = f"({prompt['written']})" if share is None else percent(share)
        title = f"{text}% {self._verb}, {prompt['counted']} of {prompt['judged']}"
        if share is None:
            title = f"{prompt['written']} written, not judged yet"
        return self._linked(prompt["task"], prompt["prompt"], text, shade(share, bad=self._bad), title)

    def _linked(self, task: str, prompt: int | None, text: str, look: str, title: str) -> dict[str, Any]:
        here = (self._filter.task, self._filter.prompt) == (task, prompt)
        which = shortened(task, MAX_NAME) + ("" if prompt is None else f", prompt {prompt}")
        query = replace(self._filter, task=task, prompt=prompt).query(self._evaluation)
        return {
            "text": text,
            "shade": f"{look} here" if here else look,
            "title": f"{which}: {title}",
            "href": f"{run_address(self._run.name)}{query}#completions",
            "here": here,
            "at": [task, prompt],
        }


def failure_rows(runs: Sequence[Snapshot]) -> list[dict[str, Any]]:
    """Return a row for each class and kind of failure, with a cell for each run. Frequent ones come first."""
    largest: dict[tuple[str, str | None], float] = {}
    for run in runs:
        largest |= {key: max(one.share, largest.get(key, 0.0)) for key, one in run.failures.items()}
    order = sorted(
        largest, key=lambda key: (-largest[key[0], None], key[0], key[1] is not None, -largest[key])
    )
    rows = []
    for name, kind in order:
        chosen = CompletionFilter(failure_class=name, failure_kind=kind)
        cells = [_failure_cell(run, chosen, run.failures.get((name, kind))) for run in runs]
        title, look = (plural_of(name), "of-all") if kind is None else (kind, "of-class")
        rows.append({"name": shortened(title, MAX_NAME), "look": look, "cells": cells})
    return rows


def _failure_cell(run: Snapshot, chosen: CompletionFilter, kind: Failures | None) -> dict[str, Any]:
    count, share = (0, 0.0) if kind is None else (kind.count, kind.share)
    text = percent(share)
    return {
        "text": text,
        "shade": shade(share, bad=True),
        "title": f"{shortened(run.name, MAX_NAME)}: {text}% ended {failure_text(chosen)}, {count:,}",
        "href": f"{run_address(run.name)}{chosen.query(None)}#completions" if count else None,
    }
