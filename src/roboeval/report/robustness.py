"""How much phrasing matters: the spread over prompts, which phrasings hurt, and the words that differ."""

from __future__ import annotations

import re
from collections.abc import Sequence

from roboeval.report.reading import JudgedRun
from roboeval.report.scores import tasks_of
from roboeval.report.sheets import Cell, Column, Sheet, sheet
from roboeval.suites.load import Suite

SPREAD = (
    "The best prompt of a task minus its worst. The words are those that stand only in the instruction of "
    "the worst prompt, and only in that of the best; what a difference of words does is a guess, and the "
    "prompts differ in more than words."
)
PHRASINGS = (
    "How much better or worse than its task a prompt does, on average over the runs that were asked it. A "
    "phrasing that hurts every model says more about the phrasing than about the models."
)
NOT_RECORDED = "instruction not recorded"
MOST_WORDS = 12


def spread_sheet(runs: Sequence[JudgedRun], suite: Suite) -> Sheet:
    """For each task and run, how far its prompts lie apart, the widest first."""
    rows = [
        row for task in tasks_of(runs, suite) for run in runs if (row := _spread_row(task, run)) is not None
    ]
    rows.sort(key=lambda row: -float(row[2] or 0))
    columns = (
        Column("task"),
        Column("model"),
        Column("spread", "share"),
        Column("worst prompt", "count"),
        Column("worst", "share"),
        Column("best prompt", "count"),
        Column("best", "share"),
        Column("words of the worst only"),
        Column("words of the best only"),
    )
    return sheet("spread", "Spread over prompts", columns, rows, about=SPREAD)


def _spread_row(task: str, run: JudgedRun) -> list[Cell] | None:
    scores = {prompt: value for (of, prompt), value in run.by_prompt.items() if of == task}
    if len(scores) < 2:  # noqa: PLR2004 - one lies not apart
        return None
    worst, best = min(scores, key=lambda p: (scores[p], p)), max(scores, key=lambda p: (scores[p], -p))
    words = only(*(instruction_of(run, task, prompt) for prompt in (worst, best)))
    return [task, run.name, scores[best] - scores[worst], worst, scores[worst], best, scores[best], *words]


def instruction_of(run: JudgedRun, task: str, prompt: int) -> str | None:
    """What the model was told for a prompt; None if nobody recorded it."""
    return run.instructions.get((task, prompt))


def only(one: str | None, other: str | None) -> tuple[str, str]:
    """The words that stand in one of two texts only, for both, in their order."""
    if one is None or other is None:
        return NOT_RECORDED, NOT_RECORDED
    first, second = words(one), words(other)
    return _listed([w for w in first if w not in second]), _listed([w for w in second if w not in first])


def words(text: str) -> list[str]:
    """The different words of a text, in small letters."""
    return list(dict.fromkeys(re.findall(r"[^\W_]+(?:['\u2019][^\W_]+)*", text.lower())))


def _listed(found: Sequence[str]) -> str:
    more = len(found) - MOST_WORDS
    return " ".join(found[:MOST_WORDS]) + (f" and {more} more" if more > 0 else "")


def phrasing_sheet(runs: Sequence[JudgedRun], suite: Suite) -> Sheet:
    """For each prompt, how it does beside the others of its task, the one that hurts most first."""
    rows: list[list[Cell]] = []
    for task in tasks_of(runs, suite):
        prompts = sorted({p for run in runs for of, p in run.by_prompt if of == task})
        for prompt in prompts if len(prompts) > 1 else ():
            off = [
                run.by_prompt[task, prompt] - sum(run.by_task[task]) / len(run.by_task[task])
                for run in runs
                if (task, prompt) in run.by_prompt
            ]
            told = {text for run in runs if (text := instruction_of(run, task, prompt)) is not None}
            text = " / ".join(sorted(told)) or NOT_RECORDED
            rows.append([task, prompt, sum(off) / len(off), sum(one < 0 for one in off), len(off), text])
    rows.sort(key=lambda row: float(row[2] or 0))
    columns = (
        Column("task"),
        Column("prompt", "count"),
        Column("beside its task", "difference"),
        Column("hurts", "count"),
        Column("of models", "count"),
        Column("instruction"),
    )
    return sheet("phrasings", "Phrasings", columns, rows, about=PHRASINGS)
