"""Renders a report as a single HTML file that works offline and is readable without JavaScript."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path

from codebotler.core.terminal import shortened
from codebotler.core.text.words import counted
from roboeval.analysis.failure_groups import FailureGroup
from roboeval.evaluation.judging.failures import label_of
from roboeval.evaluation.runs.completions import name_of
from roboeval.report.sheets import (
    Card,
    Cards,
    Cell,
    Column,
    Groups,
    Part,
    Prose,
    ReportFigure,
    Section,
    Sheet,
    format_cell,
    page_text,
)
from roboeval.suites.task import plain_check

MAX_TEXT, MAX_REPORTED_PROGRAM, MAX_DIFF_LINES = 500, 6_000, 80  # limits for text written by models
MAX_TABLE_ROWS = 1_000  # rows on the page; the CSV file contains all rows
MAX_UNFOLDED_ROWS = 24  # larger tables are folded
LONG_CELL = 70  # characters; longer cells are wrapped
PAGE_STYLE = Path(__file__).with_name("page.css")
PAGE_SCRIPT = Path(__file__).with_name("page.js")
GENERATOR = '<meta name="generator" content="RoboEval">'  # marks a page as a report
DrawnFigures = Mapping[str, bytes]  # SVG files by name


def page(title: str, lead: Sequence[str], sections: Sequence[Section], drawings: DrawnFigures) -> str:
    """Return a report as HTML, with all text escaped. `lead` introduces it; `drawings` has its SVGs."""
    script = PAGE_SCRIPT.read_text()
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{digest}'"
    titles = {_text(section.name): _text(page_text("sections", section.name)) for section in sections}
    links = "".join(f'<li><a href="#{name}">{title}</a></li>' for name, title in titles.items())
    body = "".join(_section(section, drawings) for section in sections)
    paragraphs = "".join(f"<p>{_text(words)}</p>" for words in lead)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f"{GENERATOR}\n"
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{_text(title)}</title>\n<style>\n{PAGE_STYLE.read_text()}</style>\n</head>\n<body>\n"
        f'<a class="skip" href="#main">To the results</a>\n'
        f"<header><h1>{_text(title)}</h1>{paragraphs}</header>\n"
        f'<nav aria-label="Sections"><ol>{links}</ol></nav>\n'
        f'<main id="main">\n{body}</main>\n<script>{script}</script>\n</body>\n</html>\n'
    )


def _text(words: str) -> str:
    """Escape text for HTML. Unprintable characters, such as lone surrogates, are shown as escapes."""
    shown = (c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in words)
    plain = "".join(shown)
    return escape(plain, quote=True)


def _prose(words: str) -> str:
    """Escape a sentence for HTML, and format text in backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", _text(words))


def _section(section: Section, drawings: DrawnFigures) -> str:
    parts = "".join(_part(part, drawings) for part in section.parts)
    name = _text(section.name)
    head = f'<h2 id="{name}-h">{_text(page_text("sections", section.name))}</h2>'
    return f'<section id="{name}" aria-labelledby="{name}-h">{head}\n{parts}</section>\n'


def _part(part: Part, drawings: DrawnFigures) -> str:
    match part:
        case Sheet():
            return _table(part)
        case ReportFigure():
            return _figure(part, drawings)
        case Prose(paragraphs):
            return "".join(f"<p>{_prose(words)}</p>\n" for words in paragraphs)
        case Cards(cards):
            return f'<div class="cards">{"".join(map(_card, cards))}</div>\n'
        case Groups(shown):
            return f'<div class="groups">{"".join(_failure_group(*one) for one in shown)}</div>\n'


def _card(card: Card) -> str:
    estimate = card.passed
    low, high = (100 * share for share in (estimate.low, estimate.high))
    bar = f'<i style="width: {100 * estimate.mean:.1f}%"></i>'
    if estimate.is_known:
        bar += f'<u style="left: {low:.1f}%; width: {high - low:.1f}%"></u>'
    failure = f"Most frequent failure: {_text(card.failure)}." if card.failure else "Every program passes."
    cost = f"<p>{_prose(card.cost)}</p>" if card.cost else ""
    warning = f'<p class="warning">{_prose(card.warning)}</p>' if card.warning else ""
    return (
        f'<article class="card"><h3>{_text(card.name)}</h3><p><b>{estimate.mean:.3f}</b> pass@1</p>'
        f'<div class="bar" aria-hidden="true">{bar}</div>'
        f"<p>{_text(estimate.interval)}</p><p>{_text(card.coverage)}</p>"
        f"<p>{failure}</p>{cost}{warning}</article>"
    )


# --- figures


def _figure(figure: ReportFigure, drawings: DrawnFigures) -> str:
    if figure.name not in drawings:
        return ""
    link = f"data:image/svg+xml;base64,{base64.b64encode(drawings[figure.name]).decode()}"
    caption = _text(" ".join([page_text("figures", figure.name), *figure.about]))
    name = _text(figure.name)
    return (
        f'<figure id="figure-{name}">'
        f'<div class="wide" tabindex="0" role="region" aria-label="Figure: {name}">'
        f'<img src="{link}" alt="{caption}"></div>'
        f'<figcaption>{caption} <span class="files">figures/{name}.pdf, .png</span>'
        "</figcaption></figure>\n"
    )


# --- tables


def _table(sheet: Sheet) -> str:
    filled = [n for n in range(len(sheet.columns)) if any(row[n] is not None for row in sheet.rows)]
    columns = [sheet.columns[n] for n in filled]
    heads = "".join(f'<th scope="col" class="{_css(c)}">{_text(c.head)}</th>' for c in columns)
    rows = "".join(_row([row[n] for n in filled], columns) for row in sheet.rows[:MAX_TABLE_ROWS])
    texts = page_text("tables", sheet.name)
    title, about = (_text(texts.get(name, "")) for name in ("title", "about"))
    about = f"<p>{about}</p>" if about else ""
    left = len(sheet.rows) - MAX_TABLE_ROWS
    more = [f"{counted(left, 'more row')} in the CSV file."] if left > 0 else []
    notes = "".join(f'<p class="note">{_prose(note)}</p>' for note in (*sheet.notes, *more))
    table = (
        f'<div class="wide" tabindex="0" role="region" aria-label="{title}"><table>'
        f"<thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>"
    )
    name = _text(sheet.name)
    link = f'<p class="files"><a href="tables/{name}.csv">tables/{name}.csv</a></p>'
    inside = f"{about}{table}{notes}{link}"
    if len(sheet.rows) > MAX_UNFOLDED_ROWS:
        summary = f"<summary>{title} <span>{len(sheet.rows):,} rows</span></summary>"
        return f'<details class="sheet" id="table-{name}">{summary}{inside}</details>\n'
    return f'<div class="sheet" id="table-{name}"><h3>{title}</h3>{inside}</div>\n'


NAME_BREAKS = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[_:])(?=\w)")  # where long names may break


def _css(column: Column) -> str:
    return "text" if column.kind == "class" else column.kind


def _row(row: Iterable[Cell], columns: Sequence[Column]) -> str:
    cells = []
    for number, (cell, column) in enumerate(zip(row, columns, strict=True)):
        sort = "" if cell is None or isinstance(cell, str) else f' data-v="{cell!r}"'
        words = NAME_BREAKS.sub("<wbr>", _text(format_cell(cell, column.kind)))
        is_head = number == 0 and column.kind == "text"
        tag = 'th scope="row"' if is_head else "td"
        long = " long" if isinstance(cell, str) and len(cell) > LONG_CELL else ""
        cells.append(f'<{tag} class="{_css(column)}{long}"{sort}>{words}</{"th" if is_head else "td"}>')
    return f"<tr>{''.join(cells)}</tr>"


# --- groups of failures


def _failure_group(model: str, group: FailureGroup) -> str:
    kind = f"{label_of(group.failure['class'])}: {group.failure['kind']}"
    size = len(group.members)
    data = {"model": model, "task": group.task, "kind": kind, "size": str(size)}
    attributes = "".join(f' data-{name}="{_text(value)}"' for name, value in data.items())
    check = group.failure["check"]
    why = shortened(f"{plain_check(check)}: {group.why}" if check else group.why, MAX_TEXT, str)
    return (
        f'<details class="group"{attributes}><summary><b>{size:,}</b><span>{_text(model)}, '
        f'{_text(group.task)}, {_text(kind)}<br><span class="why">{_text(why)}</span></span>'
        f'</summary><div class="inside">{_inside(group)}</div></details>\n'
    )


def _inside(group: FailureGroup) -> str:
    prompts = f"Prompt{'s' * (len(group.prompts) > 1)} {', '.join(map(str, group.prompts))}"
    world = _text(str(group.reason["world"]))
    name = _text(name_of(group.representative))
    where = "" if group.has_no_program else f", world \u201c{world}\u201d"
    head = f"<p>{prompts}. Example: {name}{where}.</p>"
    program = f"<pre>{_text(shortened(group.program, MAX_REPORTED_PROGRAM, str))}</pre>"
    fix = group.fix
    if fix is None:
        nothing = "" if group.has_no_program else "<p>No program passes this task.</p>"
        return f"{head}{program}{nothing}"
    lines = "".join(_changed(sign, line) for sign, line in fix.changes[:MAX_DIFF_LINES])
    more = f"... {len(fix.changes) - MAX_DIFF_LINES} more lines" if len(fix.changes) > MAX_DIFF_LINES else ""
    count = f"{fix.changed} line{'s' * (fix.changed != 1)}"
    return f"{head}{program}<p>{_text(fix.name)} passes and differs in {count}:</p><pre>{lines}{more}</pre>"


def _changed(sign: str, line: str) -> str:
    tag = {"-": "del", "+": "ins"}.get(sign, "span")
    words = f"{sign} {_text(shortened(line, MAX_TEXT, str))}"
    return f"<{tag}>{words}</{tag}>" if tag != "span" else f"{words}\n"
