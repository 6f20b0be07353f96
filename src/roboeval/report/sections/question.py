"""Builds the section on how much a person's answer to one question about candidate programs helps."""

from __future__ import annotations

from collections.abc import Sequence

from roboeval.evaluation.clarify import ClarifyShares, read_measurements
from roboeval.report.runs import JudgedRun
from roboeval.report.sheets import Cell, Prose, Section, section, sheet


def question_section(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on asking a person one question, for runs that `roboeval clarify` has measured."""
    found = [(run.name, *each) for run in runs for each in read_measurements(run.results)]
    rows: list[list[Cell]] = []
    by_prompt: list[list[Cell]] = []
    for name, one, is_current in found:
        if not is_current:
            continue
        noise, seed, prompts = one["noise"], one["seed"], one["prompts"]
        rows.append([name, one["candidates"], *_shares(one), noise, one["tokens"], seed, len(prompts)])
        for of in prompts:
            where = of["task"], name, of["prompt"], one["candidates"]
            by_prompt.append([*where, *_shares(of), noise, seed])
    changed = dict.fromkeys(name for name, _, is_current in found if not is_current)
    outdated = "the completions or the suite have changed; measure again with `roboeval clarify`"
    sheets = sheet("question", rows), sheet("question-prompts", by_prompt)
    return section("question", *sheets, Prose([f"{name}: {outdated}." for name in changed]))


def _shares(of: ClarifyShares) -> list[Cell]:
    return [of["one"], of["majority"], of["question"], of["asked"], of["mattered"]]
