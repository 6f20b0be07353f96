"""Builds the tables on the abilities that tasks require, and on the phrasing of instructions."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import chain
from typing import Any

import polars as pl

from roboeval.analysis.metrics import by_formula, mean_of, prompts_of
from roboeval.evaluation.judging.failures import AGENT_ERROR_CLASS, FAILURE_CLASSES
from roboeval.evaluation.runs.rows import Row, failure_of
from roboeval.evaluation.runs.traces import trace_of
from roboeval.report.runs import JudgedRun, tasks_of
from roboeval.report.sheets import Cell, Sheet, sheet

REPORT_ABILITY = "report-back"
NO_SUCH_ROOM_ERROR = "GoToInvalidLocation"
NO_INSTRUCTION = "instruction not recorded"
REPORTING_TASKS = "come back and report"
MAX_DISTINCT_WORDS = 12


def ability_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of pass@1 and causes of failures by the ability that tasks need, such as perception."""
    tasks = runs[0].suite.tasks
    found: list[tuple[list[Cell], dict[str, float]]] = []
    for ability in dict.fromkeys(ability for task in tasks.values() for ability in task.abilities):
        for run in runs:
            scores = [one for one in run.scores if one.task in tasks and ability in tasks[one.task].abilities]
            if scores:
                passed = by_formula([[p.pass_at(1) for p in one.prompts] for one in scores], over="tasks")
                is_of_these = pl.col("task").is_in([one.task for one in scores])
                failed = Counter(run.completions.filter(is_of_these)["failure_class"])
                shares = {name: failed[name] / sum(failed.values()) for name in FAILURE_CLASSES}
                estimate = passed.mean, passed.low, passed.high
                found.append(([ability, run.name, len(scores), *estimate], shares))
    agent_failed = any(shares[AGENT_ERROR_CLASS] for _, shares in found)
    shown = [name for name in FAILURE_CLASSES if name != AGENT_ERROR_CLASS or agent_failed]
    rows = [[*cells, *(shares[name] for name in shown)] for cells, shares in found]
    return sheet("abilities", rows, shares=[FAILURE_CLASSES[name].plural for name in shown])


def report_back_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table that compares tasks in which the robot must come back and report with all others."""
    reporting = {one.name for one in runs[0].suite.tasks.values() if REPORT_ABILITY in one.abilities}
    rows: list[list[Cell]] = []
    for run in runs:
        if not reporting & {score.task for score in run.scores}:
            continue
        failures = [run.results.row(key) for key in run.results.failed]
        for name, is_reporting in ((REPORTING_TASKS, True), ("others", False)):
            scores = [one for one in run.scores if (one.task in reporting) == is_reporting]
            failed = [row for row in failures if (row["task"] in reporting) == is_reporting]
            if scores:
                away = sum(map(never_returned, failed))
                lost = sum(failure_of(row)["kind"] == NO_SUCH_ROOM_ERROR for row in failed)
                shares = [count / len(failed) if failed else None for count in (away, lost)]
                passed = mean_of([[prompt.pass_at(1) for prompt in prompts_of(scores)]])
                counts = sum(one.completions for one in scores), passed, len(failed)
                rows.append([run.name, name, *counts, away, shares[0], lost, shares[1]])
    return sheet("coming-back", rows)


def never_returned(row: Row) -> bool:
    """Whether, in the failing world, the robot left its first room and did not return. False if unknown."""
    verdict = row["verdicts"][failure_of(row)["world"]]
    if "cut" in verdict:
        return False
    trace = trace_of(verdict)
    start = trace[0].place if trace else ""
    visited = [event.destination for event in trace if event.destination is not None]
    left = next((at for at, room in enumerate(visited) if room != start), None)
    return left is not None and start not in visited[left:]


# --- phrasing


def spread_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of the best and worst prompt of each task and run, largest difference first."""
    rows: list[list[Any]] = []
    for run in runs:
        for score in run.scores:
            if len(score.prompts) > 1:
                worst, best = (choose(score.prompts, key=lambda one: one.pass_at(1)) for choose in (min, max))
                ends = worst.prompt, worst.pass_at(1), best.prompt, best.pass_at(1)
                texts = [run.instructions.get((score.task, one.prompt)) for one in (worst, best)]
                rows.append([score.task, run.name, ends[3] - ends[1], *ends, *distinct_words(*texts)])
    order = tasks_of(runs)
    return sheet("spread", sorted(rows, key=lambda row: (-row[2], order.index(row[0]))))


def distinct_words(one: str | None, other: str | None) -> tuple[str, str]:
    """Return the words that are only in the first text and only in the second, or notes if a text is None."""
    if one is None or other is None:
        return NO_INSTRUCTION, NO_INSTRUCTION
    words = (re.findall(r"[^\W_]+(?:['\u2019][^\W_]+)*", text.lower()) for text in (one, other))
    first, second = map(dict.fromkeys, words)
    return _join([w for w in first if w not in second]), _join([w for w in second if w not in first])


def _join(words: Sequence[str]) -> str:
    more = len(words) - MAX_DISTINCT_WORDS
    return " ".join(words[:MAX_DISTINCT_WORDS]) + (f" and {more} more" if more > 0 else "")


def phrasing_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table that compares each prompt with the mean of its task, worst prompts first.

    It covers tasks with several prompts, and counts the runs in which a prompt is below the mean.
    """
    better: defaultdict[tuple[str, int], list[float]] = defaultdict(list)
    for score in chain.from_iterable(run.scores for run in runs):
        mean = mean_of([[prompt.pass_at(1) for prompt in score.prompts]])
        for prompt in score.prompts:
            better[score.task, prompt.prompt].append(prompt.pass_at(1) - mean)
    prompts = Counter(task for task, _ in better)
    rows = [
        [*key, mean_of([each]), sum(one < 0 for one in each), len(each), _instructions(runs, key)]
        for key, each in better.items()
        if prompts[key[0]] > 1
    ]
    order = tasks_of(runs)
    return sheet("phrasings", sorted(rows, key=lambda row: (row[2], order.index(row[0]), row[1])))


def _instructions(runs: Sequence[JudgedRun], key: tuple[str, int]) -> str:
    found = {run.instructions.get(key) for run in runs} - {None}
    return " / ".join(sorted(map(str, found))) or NO_INSTRUCTION
