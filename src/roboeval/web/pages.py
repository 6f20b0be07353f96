"""The pages of the benchmark, as `codebotler serve` finds them and `roboeval serve` opens them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fastapi.responses import RedirectResponse
from fastapi.staticfiles import StaticFiles

from codebotler.web.further import Pages, Site
from roboeval.suites.load import Suite
from roboeval.web import api, comparison_page, completion_page, run_page, runs_page
from roboeval.web.run_store import RunStore

STATIC = Path(__file__).with_name("static")


def pages(suites: Sequence[Suite] = ()) -> Pages:
    """The pages.

    Args:
        suites: by which runs may have been judged, besides those that ship with the package.
    """

    def add(site: Site) -> None:
        store = RunStore(site.runs, suites)
        site.app.include_router(api.router(store))
        site.app.mount("/static/benchmark", StaticFiles(directory=STATIC))
        for page in (runs_page, run_page, comparison_page, completion_page):
            page.add(store, site.frame)
        if not site.frame.has_robot:
            site.app.get("/", include_in_schema=False)(lambda: RedirectResponse("/runs"))

    return Pages("Benchmark", "RoboEval", "/runs", add)


PAGES = pages()
"""Named by the entry point."""
