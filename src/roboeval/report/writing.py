"""Assembles and writes a report: figures as PNG and PDF, tables as CSV, and an HTML page."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.files import write_whole
from roboeval.analysis.metrics import overall
from roboeval.evaluation.generating.requests import batches
from roboeval.evaluation.runs.scope import Coverage
from roboeval.report.figures.drawing import render, use_style
from roboeval.report.page import GENERATOR, page
from roboeval.report.paper import published_sheet
from roboeval.report.runs import JudgedRun
from roboeval.report.sections import breakdown, cost, failures, modes, question, scores
from roboeval.report.sheets import (
    Card,
    Cards,
    Cell,
    Prose,
    ReportFigure,
    Section,
    Sheet,
    page_words,
    section,
    sheet,
    write_csv,
)

FIGURE_FORMATS = ("png", "pdf")
PAGE_FILE = "index.html"
UNFINISHED = ("This report is not finished. Run its command again.",)
GENERATOR_WITHIN = 4_000  # bytes at the start of a page that are searched for its generator


def headline(runs: Sequence[JudgedRun]) -> tuple[str, list[str]]:
    """Return the title of a report and its introductory paragraphs."""
    models = {run.model for run in runs}
    one_model = len(models) == 1 and runs[0].model
    title = runs[0].name if len(runs) == 1 else one_model or f"{len(models)} models"
    each = [run.results.coverage for run in runs]
    counts = ((one.judged, one.there, one.total) for one in each)
    count = Coverage(*map(sum, zip(*counts, strict=True)))
    by_hand = [run.name for run in runs if (run.model or "").startswith("recorded:")]
    suite = runs[0].suite
    lead = [f"{count}, judged with the suite \u201c{suite.name}\u201d: {suite.about}."]
    if by_hand:
        lead.append(f"The programs of {', '.join(by_hand)} were written by hand and represent no model.")
    return f"Robot programs by {title}", lead


def sections(runs: Sequence[JudgedRun], *, with_published: bool = False, command: str = "") -> list[Section]:
    """Return non-empty report sections. `with_published` adds the paper's causes. The last has `command`."""
    found = [
        glance_section(runs),
        scores.results_section(runs),
        scores.differences_section(runs),
        failures.other_suite_section(runs),
        section("modes", modes.mode_sheet(runs), modes.ending_sheet(runs)),
        failures.house_rules_section(runs),
        scores.thresholds_section(runs),
        failures.causes_section(runs, with_published=with_published),
        failures.failures_section(runs),
        section("abilities", breakdown.ability_sheet(runs), breakdown.report_back_sheet(runs)),
        section("phrasing", breakdown.spread_sheet(runs), breakdown.phrasing_sheet(runs)),
        cost.rejection_sampling_section(runs),
        question.question_section(runs),
        section("cost", cost.cost_sheet(runs), cost.budget_sheet(runs)),
        section("prompts", scores.prompt_sheet(runs), published_sheet(runs)),
        section("origin", origin_sheet(runs), Prose([*about_suite(runs), f"`{command}`"])),
    ]
    return [one for one in found if one.parts]


def glance_section(runs: Sequence[JudgedRun]) -> Section:
    """Build the section with a card for each run and a comparison of the two best runs."""
    cards = [
        Card(
            name=run.name,
            passed=overall(run.scores, 1),
            coverage=run.coverage_sentence,
            failure=failures.most_frequent(run),
            cost=cost.cost_sentence(run),
            warning=f"{warning}." if (warning := run.results.scope.cut_off_warning) else "",
        )
        for run in runs
    ]
    return section("glance", Cards(cards), Prose(scores.leader_sentences(runs)))


def origin_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table that shows how each run was generated and judged."""
    rows: list[list[Cell]] = []
    for run in runs:
        about, head = run.results.about, run.results.manifest
        settings = about.get("settings")
        shown = None
        if isinstance(settings, dict):
            shown = ", ".join(f"{name} {json.dumps(value)}" for name, value in settings.items())
        recorded = (batch["codebotler"] for batch in batches(about) if "codebotler" in batch)
        versions = dict.fromkeys(map(str, recorded))
        asked = (shown, about.get("template"), ", ".join(versions) or None)
        judged = (head.get(name) for name in ("codebotler", "python", "digest"))
        origin = ["not recorded" if value is None else str(value) for value in (*asked, *judged)]
        rows.append([run.name, run.folder, run.completions.height, *origin])
    return sheet("runs", rows)


def about_suite(runs: Sequence[JudgedRun]) -> tuple[str, ...]:
    """Return sentences on the suite and its settings, and one that introduces the report's command."""
    head = runs[0].results.manifest
    version, digest = head.get("version"), head.get("digest")
    return (
        f'Judged with the suite "{runs[0].suite.name}", version {version}, hash {digest}.',
        f"Simulation settings: {json.dumps(head.get('rules'), ensure_ascii=False)}.",
        "With the same versions of codebotler and matplotlib, this command reproduces the report:",
    )


# --- files


def write_report(title: str, lead: Sequence[str], sections: Sequence[Section], out: Path) -> Iterator[str]:
    """Write a report to the folder `out`. Yield the name of each table and figure written, then `page`."""
    parts = [part for section in sections for part in section.parts]
    (out / "tables").mkdir(parents=True, exist_ok=True)
    if not (out / PAGE_FILE).exists():
        write_whole(out / PAGE_FILE, page(title, UNFINISHED, [], {}).encode())
    drawings: dict[str, bytes] = {}
    for part in parts:
        if isinstance(part, Sheet):
            write_csv(part, out / "tables")
            yield part.name
        elif isinstance(part, ReportFigure):
            with use_style():
                files = render(part.draw())
            for kind in FIGURE_FORMATS:
                write_whole(out / "figures" / f"{part.name}.{kind}", files[kind])
            drawings[part.name] = files["svg"]
            yield part.name
    write_whole(out / PAGE_FILE, page(title, lead, sections, drawings).encode())
    written = {part.name for part in parts if isinstance(part, Sheet | ReportFigure)}
    for name in {*page_words()["figures"], *page_words()["tables"]} - written:
        for file in (f"tables/{name}.csv", *(f"figures/{name}.{kind}" for kind in FIGURE_FORMATS)):
            (out / file).unlink(missing_ok=True)
    yield "page"


def expect_no_others(out: Path) -> None:
    """Raise UserError if a folder has files but no report, so that a new report does not replace them."""
    if not out.is_dir():
        return
    others = sorted(one.name for one in out.iterdir() if not one.name.startswith("."))
    page_file = out / PAGE_FILE
    start = page_file.read_bytes()[:GENERATOR_WITHIN] if page_file.is_file() else b""
    if others and GENERATOR.encode() not in start:
        found = f'contains other files such as "{others[0]}"'
        raise UserError(f"the folder is not a report but {found}; choose another folder", file=out)


def count_parts(sections: Sequence[Section]) -> int:
    """Count the names that `write_report` yields, to show its progress."""
    return 1 + sum(isinstance(part, Sheet | ReportFigure) for section in sections for part in section.parts)
