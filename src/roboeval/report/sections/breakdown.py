"""Builds the sections on the abilities that tasks require, and on the phrasing of instructions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import polars as pl

from roboeval.analysis.counting.breakdown import (
    by_ability,
    compare_phrasings,
    compare_report_back,
    spread_by_task,
)
from roboeval.analysis.counting.counts import prompt_scores
from roboeval.evaluation.judging.failures import AGENT_ERROR_CLASS, FAILURE_CLASSES
from roboeval.report.runs import JudgedRun, tasks_of
from roboeval.report.sheets import Cell, Section, Sheet, section, sheet

NO_INSTRUCTION = "instruction not recorded"
REPORTING_TASKS = "come back and report"
MAX_DISTINCT_WORDS = 12


def abilities(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on failures by required ability (paper, section V.B)."""
    return section("abilities", ability_sheet(runs), report_back_sheet(runs))


def ability_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of pass@1 and causes of failures by ability."""
    order: list[str] = [ability for task in runs[0].suite.tasks.values() for ability in task.abilities]
    found = {(row[0], run.name): row[1:] for run in runs for row in by_ability(run.table, run.suite)}
    agent_failed = any(row[-1][AGENT_ERROR_CLASS] for row in found.values())
    shown = [name for name in FAILURE_CLASSES if name != AGENT_ERROR_CLASS or agent_failed]
    rows: list[list[Cell]] = []
    for ability, name in sorted(found, key=lambda key: order.index(key[0])):
        tasks, at, failed = found[ability, name]
        rows.append([ability, name, tasks, at.mean, at.low, at.high, *(failed[name] for name in shown)])
    return sheet("abilities", rows, shares=[FAILURE_CLASSES[name].plural for name in shown])


def report_back_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table that compares the tasks that end with a report to all other tasks."""
    rows: list[list[Cell]] = []
    for run in runs:
        for reports, completions, failed, away, lost, passed in compare_report_back(run.results).iter_rows():
            tasks = REPORTING_TASKS if reports else "others"
            shares = [count / failed if failed and count is not None else None for count in (away, lost)]
            rows.append([run.name, tasks, completions, passed, failed, away, shares[0], lost, shares[1]])
    return sheet("coming-back", rows)


# --- phrasing


def phrasings(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on the effect of an instruction's phrasing (paper, section V.A)."""
    return section("phrasing", spread_sheet(runs), phrasing_sheet(runs))


def spread_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of the spread of pass@1 over the prompts of each task and run, widest spread first."""
    order = tasks_of(runs)
    found = [(run, row) for run in runs for row in spread_by_task(run.table).iter_rows()]
    rows = []
    for run, (task, width, *ends) in sorted(found, key=lambda pair: (-pair[1][1], order.index(pair[1][0]))):
        texts = [run.instructions.get((task, prompt)) for prompt in (ends[0], ends[2])]
        rows.append([task, run.name, width, *ends, *distinct_words(*texts)])
    return sheet("spread", rows)


def distinct_words(one: str | None, other: str | None) -> tuple[str, str]:
    """Return the words that occur only in the first text, and the words that occur only in the second."""
    if one is None or other is None:
        return NO_INSTRUCTION, NO_INSTRUCTION
    words = (re.findall(r"[^\W_]+(?:['\u2019][^\W_]+)*", text.lower()) for text in (one, other))
    first, second = map(dict.fromkeys, words)
    return _join([w for w in first if w not in second]), _join([w for w in second if w not in first])


def _join(words: Sequence[str]) -> str:
    more = len(words) - MAX_DISTINCT_WORDS
    return " ".join(words[:MAX_DISTINCT_WORDS]) + (f" and {more} more" if more > 0 else "")


def phrasing_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table that compares each prompt with the mean of its task, most harmful prompts first."""
    order = tasks_of(runs)
    scores = [prompt_scores(run.table).with_columns(model=pl.lit(at)) for at, run in enumerate(runs)]
    found = compare_phrasings(pl.concat(scores)).rows()
    rows = sorted(found, key=lambda row: (row[2], order.index(row[0]), row[1]))
    return sheet("phrasings", [[*row, _instructions(runs, row[:2])] for row in rows])


def _instructions(runs: Sequence[JudgedRun], key: Any) -> str:  # noqa: ANN401 - table cells may have any type
    found = {run.instructions.get(key) for run in runs} - {None}
    return " / ".join(sorted(map(str, found))) or NO_INSTRUCTION
