"""Parts of the pages that the browser draws from data: a table of shades, a long list, a program."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from keyword import kwlist
from typing import Any, TypeAlias

from nicegui import ui
from nicegui.element import Element

from codebotler.skills import SKILLS
from codebotler.terminal import shortened
from codebotler.web.frame import Frame

STYLE = '<link rel="stylesheet" href="/static/benchmark/benchmark.css">'
MOST_LINES, MOST_CHARACTERS = 1_000, 100_000
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
"""How a piece of a line looks, and what it says."""


def begin(frame: Frame, title: str) -> None:
    """Begin a page of the benchmark.

    Args:
        frame: what all pages have.
        title: of this one.
    """
    frame(title, "/runs")
    ui.add_head_html(STYLE)


class Heat(Element, component="static/heat.js"):
    """A table of shares.

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
        """Show other numbers.

        Args:
            groups: of columns, with `name`, `href` and `columns`; each of these with `name`, `told`, `href`.
            rows: with `name` and `cells`; each of these with `text`, `look`, `told`, `href`, `here`, `at`.
        """
        now = {"groups": list(groups), "rows": list(rows)}
        if any(self._props[name] != value for name, value in now.items()):
            self._props.update(now)
            self.update()


class Rows(Element, component="static/rows.js"):
    """A list of completions.

    Args:
        base: the address below which each has its page.
    """

    def __init__(self, base: str) -> None:
        super().__init__()
        self._props.update(base=base, source="", query="", version=0)

    def show(self, source: str, query: str, version: int) -> None:
        """Show others.

        Args:
            source: the address of the API that lists them.
            query: what stands behind the addresses of their pages.
            version: another one when they have changed.
        """
        now = {"source": source, "query": query, "version": version}
        if any(self._props[name] != value for name, value in now.items()):
            self._props.update(now)
            self.update()


class Code(Element, component="static/code.js"):
    """A program.

    Args:
        program: its source; any text.
        marked: the lines that are marked, counted from 1.
    """

    def __init__(self, program: str, marked: Iterable[int]) -> None:
        super().__init__()
        lines = re.split("\r\n|\r|\n", program.rstrip("\n"))
        shown = [shortened(line.expandtabs(4)) for line in lines[:MOST_LINES]]
        self.left_out = len(lines) - len(shown)
        self._props.update(lines=list(_coloured(shown)), marked=sorted(set(marked)))


def _coloured(lines: list[str]) -> Iterator[list[Part]]:
    """The lines of a program, in pieces that look alike."""
    text = "\n".join(lines)
    if len(text) > MOST_CHARACTERS:  # colours are not worth the wait
        yield from ([("", line)] for line in lines)
        return
    line: list[Part] = []
    for look, words in _pieces(text):
        first, *others = words.split("\n")
        _add(line, look, first)
        for other in others:
            yield line
            line = []
            _add(line, look, other)
    yield line


def _pieces(text: str) -> Iterator[Part]:
    end = 0
    for found in WORDS.finditer(text):
        yield "", text[end : found.start()]
        yield found.lastgroup or "", found[0]
        end = found.end()
    yield "", text[end:]


def _add(line: list[Part], look: str, words: str) -> None:
    if line and line[-1][0] == look:
        words = line.pop()[1] + words
    if words:
        line.append((look, words))
