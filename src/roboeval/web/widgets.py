"""Defines elements that the pages share: heat maps, lists, programs, and the progress of runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from keyword import kwlist
from typing import Any

from nicegui import html, ui
from nicegui.element import Element

from codebotler.core.errors import UserError
from codebotler.core.skills.declaration import all_names
from codebotler.core.terminal import shortened
from codebotler.web.frame import Frame, PlainText, outside
from roboeval.analysis.metrics import Estimate
from roboeval.evaluation.judging.explanation import first_lines
from roboeval.evaluation.runs.scope import Coverage
from roboeval.web.heat_map import MISSING
from roboeval.web.run_store import MissingError
from roboeval.web.serializers import RunState

STYLESHEET_LINK = '<link rel="stylesheet" href="{prefix}/static/benchmark/benchmark.css">'
REFRESH_SECONDS = 1.0  # interval between refreshes of a page
MAX_PAGE_TITLE = 80


@contextmanager
def page_of(frame: Frame, title: str) -> Iterator[None]:
    """Draw the frame of a page, for the `with` block to fill. The page shows a UserError as a sentence."""
    frame(shortened(title, MAX_PAGE_TITLE), "/runs")
    ui.add_head_html(STYLESHEET_LINK.format(prefix=outside("")))
    with ui.element("div").classes("benchmark"):
        try:
            yield
        except UserError as error:
            if isinstance(error, MissingError):
                ui.context.client.status_code = HTTPStatus.NOT_FOUND
            PlainText("p", str(error), "trouble").props("role=alert")
            html.a("All runs", href=outside("/runs"))


class _DataElement(Element):
    def show(self, **props: object) -> None:
        """Send properties to the browser if they have changed."""
        if any(self._props.get(name) != value for name, value in props.items()):
            self._props.update(props)
            self.update()


class HeatMap(_DataElement, component="static/heat.js"):
    """A table of shares as shaded cells. A click calls `chosen` with task and prompt, or opens a link.

    Its properties are `groups` with `name`, `href` and `columns` (`name`, `title`, `href`), and `rows` with
    `name` and `cells` (`text`, `shade`, `title`, `href`, `at`).
    """

    def __init__(
        self, label: str, corner: str, chosen: Callable[[str, int | None], None] | None = None
    ) -> None:
        super().__init__()
        props = {"prefix": outside(""), "label": label, "corner": corner, "chooses": chosen is not None}
        self._props.update(props, groups=[], rows=[])
        if chosen is not None:
            self.on("choose", lambda event: chosen(*event.args))


class CompletionList(_DataElement, component="static/rows.js"):
    """A list of completions. The browser fetches only those in view.

    Its properties are `source` (the URL of the API), `base` and `query` (parts of the URLs of completion
    pages), and `version`, which changes when the completions change.
    """


class ProgramView(Element, component="static/code.js"):
    """A program in which some lines, numbered from 1, are marked. The text need not be valid Python."""

    def __init__(self, program: str, marked: Iterable[int]) -> None:
        super().__init__()
        shown, self.left_out = first_lines(program)
        self._props.update(program=shown, marked=sorted(set(marked)), keywords=kwlist, skills=all_names())


# --- progress of a run, from `run_data`


def show_state(data: Mapping[str, Any], label: PlainText, bar: Element | None = None) -> None:
    """Show a run's state on a label and, if there is a bar, its progress. `data` is the run's `run_data`."""
    state = str(data["state"])
    label.show_text(state)
    label.classes(replace=f"state state-{state.replace(' ', '-')}")
    if bar is not None:
        names = ("completions", "requested") if state == RunState.GENERATING else ("judged", "to_judge")
        done, total = (data.get(name) or 0 for name in names)
        bar.set_visibility(state in {RunState.GENERATING, RunState.JUDGING})
        bar.props(f"value={done / total if total else 0:.3f}").props["aria-label"] = f"{done:,} of {total:,}"


def count_text(data: Mapping[str, Any]) -> str:
    """Format progress as `12 of 80 judged`, or as `12 of 80 written` if no completion is judged."""
    if "completions" not in data:
        return MISSING
    coverage = Coverage(data["judged"], data["to_judge"], data["requested"])
    done, what = (coverage.judged, "judged") if coverage.judged else (coverage.there, "written")
    return f"{done:,} of {coverage.total:,} {what}"


def tasks_text(data: Mapping[str, Any]) -> str:
    """Format how many tasks of the suite have completions, such as `3 of 16`."""
    if "tasks_there" not in data:
        return MISSING
    total = data["tasks_of_suite"]
    return f"{data['tasks_there']:,}" + ("" if total is None else f" of {total:,}")


def date_text(data: Mapping[str, Any]) -> str:
    """Format the start time of a run in UTC, such as `2026-11-29 12:30`, or `-` if it was not recorded."""
    return (data.get("date") or MISSING)[:16].replace("T", " ")


def score_text(mean: Estimate | None) -> str:
    """Format pass@1 of a run and its interval. Return an empty string if nothing was judged."""
    return "" if mean is None else f"pass@1 {mean.mean:.3f} ({mean.interval})"
