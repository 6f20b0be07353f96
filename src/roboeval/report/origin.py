"""Where a report comes from: what was judged, by what, and the command that makes it again."""

from __future__ import annotations

import json
from collections.abc import Sequence

from roboeval.report.reading import JudgedRun
from roboeval.report.sheets import Cell, Column, Sheet, sheet
from roboeval.suites.load import Suite

ABOUT = "How the completions were asked for, as far as their runs say it, and with what they were judged."


def origin_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """How each run came about."""
    rows: list[list[Cell]] = [
        [
            run.name,
            run.folder,
            run.completions.height,
            _settings(run.results.about.get("settings")),
            _text(run.results.about.get("template")),
            _text(run.results.about.get("codebotler")),
            _text(run.results.head.get("codebotler")),
            _text(run.results.head.get("python")),
            _text(run.results.head.get("digest")),
        ]
        for run in runs
    ]
    columns = (
        Column("model"),
        Column("folder"),
        Column("completions", "count"),
        Column("settings"),
        Column("prompt template"),
        Column("asked by codebotler"),
        Column("judged by codebotler"),
        Column("judged with Python"),
        Column("suite hash"),
    )
    return sheet("runs", "Runs", columns, rows, about=ABOUT)


def _settings(settings: object) -> str:
    if not isinstance(settings, dict):
        return "not recorded"
    return ", ".join(f"{name} {json.dumps(value)}" for name, value in settings.items())


def _text(value: object) -> str:
    return "not recorded" if value is None else str(value)


def about_suite(suite: Suite, runs: Sequence[JudgedRun]) -> tuple[str, ...]:
    """By what was judged, in sentences."""
    head = runs[0].results.head
    rules = json.dumps(head.get("rules"), ensure_ascii=False)
    return (
        f'Judged by the suite "{suite.name}", version {head.get("version")}, content {head.get("digest")}.',
        f"Its rules: {rules}.",
        "The same runs give the same bytes with the same versions of codebotler and matplotlib:",
    )
