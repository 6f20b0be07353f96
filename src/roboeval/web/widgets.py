"""What the browser draws from data: heat maps, long lists and programs; and how a run is doing, as text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from keyword import kwlist
from typing import Any, TypeAlias

from nicegui import html, ui
from nicegui.element import Element

from codebotler.badinput import BadInput
from codebotler.skills import SKILLS
from codebotler.terminal import shortened
from codebotler.web.frame import Frame
from codebotler.web.words import Words
from roboeval.web.heat_map import NONE
from roboeval.web.serializers import State

STYLE = '<link rel="stylesheet" href="/static/benchmark/benchmark.css">'
EVERY = 1.0
"""Seconds after which a page looks whether something has changed."""

MOST_LINES, MOST_COLOURED = 1_000, 100_000
WORDS = re.compile(
    r"""
    (?P<comment> \#[^\n]*)
    | (?P<string> (?:\b[rbfuRBFU]{1,2})? (?: '{3}[\s\S]*?(?:'{3}|\Z) | "{3}[\s\S]*?(?:"{3}|\Z)
        | '(?:\\.|[^'\\\n])*'? | "(?:\\.|[^"\\\n])*"? ))
    | \b(?: (?P<keyword> KEYWORDS) | (?P<skill> SKILLS)(?=\s*\() )\b
    """.replace("KEYWORDS", "|".join(kwlist)).replace("SKILLS", "|".join(SKILLS)),
    re.VERBOSE,
)
"""What is coloured in a program. It need be no Python that could run; strings may lack their end."""

Part: TypeAlias = tuple[str, str]
"""A piece of a line: its CSS class, and its text."""


@contextmanager
def page(frame: Frame, title: str) -> Iterator[None]:
    """A page of the benchmark; of an error that a user can cause, only its sentence is shown.

    Args:
        frame: what all pages have.
        title: of this one.
    """
    frame(title, "/runs")
    ui.add_head_html(STYLE)
    with ui.element("div").classes("benchmark"):
        try:
            yield
        except BadInput as error:
            Words("p", error.sentence, "trouble").props("role=alert")
            html.a("All runs", href="/runs")


class _DataElement(Element):
    def _change(self, **props: object) -> None:
        """Send other data to the browser, where they are others."""
        if any(self._props[name] != value for name, value in props.items()):
            self._props.update(props)
            self.update()


class HeatMap(_DataElement, component="static/heat.js"):
    """A table of shares, each cell with a shade.

    Args:
        label: what it is, for those who do not see it.
        corner: what its rows are.
        chosen: called with the task and the prompt of a cell that is clicked; by default cells are links.
    """

    def __init__(
        self, label: str, corner: str, chosen: Callable[[str, int | None], None] | None = None
    ) -> None:
        super().__init__()
        self._props.update(label=label, corner=corner, groups=[], rows=[], chooses=chosen is not None)
        if chosen is not None:
            self.on("choose", lambda event: chosen(*event.args))

    def show(self, groups: Sequence[Mapping[str, Any]], rows: Sequence[Mapping[str, Any]]) -> None:
        """Show these numbers.

        Args:
            groups: of columns, with `name`, `href` and `columns`; each of these with `name`, `title`, `href`.
            rows: with `name` and `cells`; each of these with `text`, `shade`, `title`, `href`, `here`, `at`.
        """
        self._change(groups=list(groups), rows=list(rows))


class CompletionList(_DataElement, component="static/rows.js"):
    """A list of completions, of which the browser fetches those in view.

    Args:
        base: the address below which each has its page.
    """

    def __init__(self, base: str) -> None:
        super().__init__()
        self._props.update(base=base, source="", query="", version=0)

    def show(self, source: str, query: str, version: int) -> None:
        """Show these completions.

        Args:
            source: the address of the API that lists them.
            query: of the addresses of their pages.
            version: differs when they have changed.
        """
        self._change(source=source, query=query, version=version)


class Code(Element, component="static/code.js"):
    """A program.

    Args:
        program: its source; any text.
        marked: the lines that are marked, counted from 1.
    """

    def __init__(self, program: str, marked: Iterable[int]) -> None:
        super().__init__()
        lines = re.split("\r\n|\r|\n", program.rstrip("\n"))
        shown = "\n".join(shortened(line.expandtabs(4)) for line in lines[:MOST_LINES])
        self.left_out = max(0, len(lines) - MOST_LINES)
        self._props.update(lines=_coloured(shown), marked=sorted(set(marked)))


def _coloured(text: str) -> list[list[Part]]:
    """The lines of a program, in pieces of one colour."""
    lines: list[list[Part]] = [[]]
    for colour, words in _pieces(text):
        for number, part in enumerate(words.split("\n")):
            if number:
                lines.append([])
            if part:
                lines[-1].append((colour, part))
    return lines


def _pieces(text: str) -> Iterator[Part]:
    end = 0
    if len(text) <= MOST_COLOURED:  # of more, colours are not worth the wait
        for found in WORDS.finditer(text):
            yield "", text[end : found.start()]
            yield found.lastgroup or "", found[0]
            end = found.end()
    yield "", text[end:]


# --- how a run is doing, from its data in short


def draw_state(data: Mapping[str, Any], label: Words, bar: Element | None = None) -> None:
    """Show how far a run has come.

    Args:
        data: as `run_data` gives it.
        label: that says it.
        bar: of its progress.
    """
    state = str(data["state"])
    label.say(state)
    label.classes(replace=f"state state-{state.replace(' ', '-')}")
    if bar is not None:
        written, judged = (
            (data.get("completions", 0), data.get("wanted")),
            (data.get("judged", 0), data.get("to_judge")),
        )
        done, of = written if state == State.GENERATING else judged
        bar.set_visibility(state in {State.GENERATING, State.JUDGING})
        bar.props(f"value={done / of if of else 0:.3f}").props["aria-label"] = f"{done:,} of {of or 0:,}"


def count_text(data: Mapping[str, Any]) -> str:
    """How many completions a run has, and of how many, where some are missing."""
    if "completions" not in data:
        return NONE
    written, wanted, judged = data["completions"], data["wanted"], data["judged"]
    if wanted is not None and written < wanted:
        return f"{written:,} of {wanted:,} written"
    if judged < data["to_judge"]:
        return f"{judged:,} of {data['to_judge']:,} judged"
    return f"{judged or written:,}"


def score_text(data: Mapping[str, Any]) -> str:
    """How often a run's programs pass; empty where nothing was judged."""
    mean = data.get("pass@1")
    if mean is None:
        return ""
    return f"pass@1 {mean['mean']:.3f} (95% interval {mean['low']:.2f} to {mean['high']:.2f})"
