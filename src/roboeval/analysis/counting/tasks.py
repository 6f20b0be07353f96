"""Summarises the results of a task by prompt, and of a prompt by program."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import polars as pl

from roboeval.analysis.counting.counts import completions_of, task_scores
from roboeval.evaluation.judging.explanation import reason, suite_instruction
from roboeval.evaluation.runs.completions import KEY, Completion, CompletionKey
from roboeval.evaluation.runs.results import Results


def task_data(results: Results, task: str) -> dict[str, Any]:
    """Summarise a task as plain data: the pass rate and kinds of failure of each prompt."""
    suite = results.suite
    of_task = completions_of(results.table).filter(pl.col("task") == task).sort("prompt", maintain_order=True)
    return {
        "task": task,
        "summary": suite.tasks[task].summary if suite is not None and task in suite.tasks else None,
        "prompts": [
            {**_prompt_head(results, of_prompt), "failures": _failure_kinds(of_prompt)}
            for of_prompt in of_task.partition_by("prompt", maintain_order=True)
        ],
    }


def prompt_data(results: Results, task: str, prompt: int) -> dict[str, Any]:
    """Summarise a judged prompt as plain data: its distinct programs, and why each of them fails."""
    of_prompt = completions_of(results.table).filter(pl.col("task") == task, pl.col("prompt") == prompt)
    programs = results.programs
    groups: dict[str, list[int]] = defaultdict(list)
    for index in of_prompt["index"]:
        groups[programs[task, prompt, index]].append(index)
    return {
        "task": task,
        **_prompt_head(results, of_prompt),
        "programs": [
            {"indices": same, **_reason(results, (task, prompt, same[0]))} for same in groups.values()
        ],
    }


def _reason(results: Results, key: CompletionKey) -> dict[str, Any]:
    row = results.row(key)
    if row["passed"]:
        return {"passed": True, "failure": None}
    return reason(row, results.suite, ablated=results.is_ablated)


def _prompt_head(results: Results, of_prompt: pl.DataFrame) -> dict[str, Any]:
    written = [results.completions[key] for key in of_prompt.select(KEY).iter_rows()]
    (of_task,) = task_scores(of_prompt)
    (score,) = of_task.prompts
    task, prompt = score.task, score.prompt
    requested = results.scope.requested
    prompts = () if results.suite is None else results.suite.task(task).prompts
    return {
        "prompt": prompt,
        "instructions": _distinct(written, "instruction"),
        "suite_instruction": suite_instruction(results.suite, task, prompt),
        "models": _distinct(written, "model"),
        "completions": score.completions,
        "requested": None if requested is None else requested.get(task, 0) // len(prompts),
        "passed": score.passed,
        "pass@1": score.pass_at(1),
    }


def _distinct(written: Sequence[Completion], name: str) -> list[str]:
    values = dict.fromkeys(getattr(completion, name) for completion in written)
    return [value for value in values if value is not None]


def _failure_kinds(of_prompt: pl.DataFrame) -> list[dict[str, Any]]:
    """Count the kinds of failure, the most frequent first, each with the index of its first completion."""
    failed = of_prompt.drop_nulls("failure_class").select("failure_class", "failure_kind", "index")
    indices: dict[tuple[str, str], list[int]] = defaultdict(list)
    for name, kind, index in failed.iter_rows():
        indices[name, kind].append(index)
    return [
        {"class": name, "kind": kind, "count": len(those), "example": those[0]}
        for (name, kind), those in sorted(indices.items(), key=lambda one: -len(one[1]))
    ]
