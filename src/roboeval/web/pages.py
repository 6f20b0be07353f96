"""Registers the pages of the benchmark for `roboeval serve` and, via an entry point, `codebotler serve`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from fastapi import Query, Request
from fastapi.responses import RedirectResponse
from fastapi.staticfiles import StaticFiles
from nicegui import ui

from codebotler.web.frame import PAGE_BUILD_SECONDS, Pages, Site
from codebotler.web.security.proxy import prefix_of
from roboeval.suites.load import Suite
from roboeval.web.api import EvaluationQuery, FilterQuery, router
from roboeval.web.comparison_page import draw_comparison
from roboeval.web.completion_page import draw_completion
from roboeval.web.run_page import draw_run
from roboeval.web.run_store import RunStore
from roboeval.web.runs_page import draw_runs
from roboeval.web.serializers import RunList
from roboeval.web.widgets import page_of


def pages(suites: Sequence[Suite] = ()) -> Pages:
    """Return the pages of the benchmark. Runs may be judged by `suites` as well as by installed suites."""

    def add(site: Site) -> None:
        store = RunStore(site.runs, suites)
        all_runs = RunList(store)
        site.app.include_router(router(store, all_runs))
        site.app.mount("/static/benchmark", StaticFiles(directory=Path(__file__).with_name("static")))
        if not site.frame.has_robot:
            site.app.get("/", include_in_schema=False)(_redirect_to_runs)

        @ui.page("/runs", response_timeout=PAGE_BUILD_SECONDS)
        async def show_runs() -> None:
            with page_of(site.frame, "Runs"):
                await draw_runs(store.folder, all_runs)

        @ui.page("/runs/{run}", response_timeout=PAGE_BUILD_SECONDS)
        async def show_run(run: str, chosen: FilterQuery, evaluation: EvaluationQuery = None) -> None:
            with page_of(site.frame, run):
                await draw_run(store, run, chosen, evaluation)

        @ui.page("/runs/{run}/{name:path}", response_timeout=PAGE_BUILD_SECONDS)
        async def show_completion(
            run: str, name: str, chosen: FilterQuery, evaluation: EvaluationQuery = None
        ) -> None:
            with page_of(site.frame, name):
                await draw_completion(store, run, name, chosen, evaluation)

        @ui.page("/side-by-side", response_timeout=PAGE_BUILD_SECONDS)
        async def compare_runs(run: Annotated[list[str] | None, Query()] = None) -> None:
            with page_of(site.frame, "Side by side"):
                await draw_comparison(store, list(dict.fromkeys(run or ())))

    return Pages("Benchmark", "RoboEval", "/runs", add)


def _redirect_to_runs(request: Request) -> RedirectResponse:
    return RedirectResponse(f"{prefix_of(request.scope)}/runs")


PAGES = pages()
"""The pages that `codebotler serve` finds by the entry point `codebotler.pages`."""
