"""Provides the published results of the paper, and decides which runs can be compared with them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from roboeval.analysis.counting.summary import Causes
from roboeval.report.runs import JudgedRun
from roboeval.report.sheets import Cell, Sheet, note, sheet

PAPER_SUITE = "paper"


@cache
def published() -> dict[str, Any]:
    """Read the published results of the paper: pass@1 by task and prompt, and the causes of failures."""
    data: dict[str, Any] = json.loads(Path(__file__).with_name("published.json").read_text())
    return data


def model_of(run: JudgedRun) -> str | None:
    """Return the paper's name for a run's model, or None if it is unknown or another suite judged the run."""
    if run.results.manifest.get("suite") != PAPER_SUITE or run.is_mixed:
        return None
    provider, colon, name = (run.model or run.folder).lower().partition(":")
    known = published()["names"] | ({} if colon else published()["short_names"])
    model: str | None = known.get(name or provider)
    return model


def recognised_models(runs: Iterable[JudgedRun]) -> list[str]:
    """Say which runs are recognised as models of the paper, in one sentence. Return [] if none is."""
    pairs = [f"{run.name} is {model}" for run in runs if (model := model_of(run)) is not None]
    return [f"Recognised by name as models of the paper: {', '.join(pairs)}."] if pairs else []


def uses_authors_prompts(run: JudgedRun) -> bool:
    """Whether a run's completions were imported and answer the prompts of the paper's authors."""
    ours = {prompt for task in run.suite.tasks.values() for prompt in task.prompts}
    return "settings" not in run.results.about and not ours & {*run.instructions.values()}


def cell(model: str, task: str, prompt: int) -> float | None:
    """Return a model's published pass@1 on one of the paper's prompts (from 0), or None if there is none."""
    rows = published()["pass_at_1"].get(task, [])
    return rows[prompt][_column(model)] if prompt < len(rows) else None


def task_mean(model: str, task: str) -> float | None:
    """Return a model's published mean pass@1 over the prompts of a task, or None if there is none."""
    rows = published()["pass_at_1"].get(task)
    return None if rows is None else sum(row[_column(model)] for row in rows) / len(rows)


def overall_mean(model: str, tasks: Sequence[str]) -> float | None:
    """Return a model's published pass@1, averaged over tasks, or None if it is missing for a task."""
    means = [mean for task in tasks if (mean := task_mean(model, task)) is not None]
    return sum(means) / len(means) if means and len(means) == len(tasks) else None


def causes(model: str) -> Causes:
    """Return the published causes of a model's failures, given the paper's name for the model."""
    at, classes, kinds = _column(model), published()["classes"], published()["kinds"]
    return Causes(
        {name: shares[at] / 100 for name, shares in classes.items()},
        {name: {kind: n[at] / 100 for kind, n in of.items() if n[at]} for name, of in kinds.items()},
        {},
    )


def _column(model: str) -> int:
    return int(published()["models"].index(model))


def published_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table that compares each task's pass@1 with the paper's, for runs of the paper's models."""
    known = [(run, model) for run in runs if (model := model_of(run)) is not None]
    rows: list[list[Cell]] = []
    for run, model in known:
        means = {score.task: score.pass_at(1).mean for score in run.scores}
        pairs = [(task, mean, task_mean(model, task)) for task, mean in means.items()]
        pairs.append(("all of these", run.mean, overall_mean(model, [*means])))
        for task, ours, theirs in pairs:
            rows.append([task, run.name, ours, theirs, None if theirs is None else ours - theirs])
    phrasings = [] if all(uses_authors_prompts(run) for run, _ in known) else [note("other-phrasings")]
    return sheet("published", rows, notes=[*recognised_models(runs), *phrasings, note("two-sums")])
