"""Builds the section on house rules: how often programs break them, and their effect on pass@1."""

from __future__ import annotations

from collections.abc import Sequence

from roboeval.analysis.broken_rules import BrokenRules, count_broken_rules
from roboeval.analysis.counts import task_scores
from roboeval.analysis.metrics import overall
from roboeval.report.runs import JudgedRun
from roboeval.report.sheets import Cell, Section, Sheet, section, sheet


def house(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on house rules, for runs judged both with and without them."""
    found = [
        (run, count_broken_rules(run.house.table, run.results.table)) for run in runs if run.house is not None
    ]
    return section("house", rules_sheet(found), broken_sheet(found))


def rules_sheet(found: Sequence[tuple[JudgedRun, BrokenRules]]) -> Sheet:
    """Build the table of the share of programs that break rules, and of pass@1 without and with the rules."""
    rows: list[list[Cell]] = []
    notes = []
    for run, one in found:
        assert run.house is not None
        assert one.cost is not None
        broken = one.broken
        scores = overall(run.scores, 1).mean, overall(task_scores(run.house.table), 1).mean
        cost = one.cost.mean, one.cost.low, one.cost.high
        rows.append([run.name, broken.mean, broken.low, broken.high, *scores, *cost])
        measured = ("share that breaks a rule", broken), ("difference", one.cost)
        notes += [
            f"{run.name}: the interval of the {what} is {estimate.ends()}."
            for what, estimate in measured
            if not estimate.is_known
        ]
    return sheet("house", rows, notes=notes)


def broken_sheet(found: Sequence[tuple[JudgedRun, BrokenRules]]) -> Sheet:
    """Build the table that counts the programs stopped by each rule in at least one world."""
    rows = [[rule, run.name, count] for run, one in found for rule, count in one.by_rule.items()]
    return sheet("broken-rules", rows)
