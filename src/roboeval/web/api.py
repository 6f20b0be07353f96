"""Defines the HTTP API, which returns runs, their prompts, and their completions with verdicts."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Annotated, TypeAlias

from fastapi import APIRouter, Depends, HTTPException, Query
from fastapi.responses import HTMLResponse, Response

from codebotler.core.errors import UserError
from roboeval.evaluation.runs.completions import name_of
from roboeval.web.run_store import MissingError, RunStore
from roboeval.web.serializers import RunList, completion_details, entry_data, run_details
from roboeval.web.snapshot import CompletionFilter

MAX_PAGE_SIZE = 1_000
"""The largest number of completions in a response."""

REPORT_POLICY = (
    "sandbox allow-downloads; default-src 'none'; style-src 'unsafe-inline'; img-src data:; "
    "script-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

TABLE_NAME = re.compile(r"[\w-]{1,100}")  # excludes paths to other folders

FilterQuery: TypeAlias = Annotated[CompletionFilter, Depends()]
EvaluationQuery: TypeAlias = Annotated[
    str | None,
    Query(max_length=200, description="Name of the evaluation (default: the first that is not an ablation)."),
]


def router(store: RunStore, all_runs: RunList) -> APIRouter:
    """Create the routes below `/api/runs`, which return runs and completions as JSON, and reports."""
    errors = [Depends(_raise_http_errors)]
    api = APIRouter(prefix="/api/runs", tags=["runs"], default_response_class=Response, dependencies=errors)

    @api.get("")
    def list_runs() -> Response:
        """List all runs with their models, progress and pass rates."""
        return _json(all_runs.data())

    @api.get("/{run}")
    def show_run(run: str, evaluation: EvaluationQuery = None) -> Response:
        """Return one run, with the pass rate of each prompt and the number of failures of each kind."""
        return _json(run_details(store.open(run, evaluation)))

    @api.get("/{run}/report")
    def show_report(run: str) -> Response:
        """Return the report in a run's folder as HTML. `roboeval run` and `roboeval report` write reports."""
        # Forbid scripts, because the folder may contain any page instead of a report.
        headers = {"content-security-policy": REPORT_POLICY, "cache-control": "no-store"}
        return HTMLResponse(store.report(run), headers=headers)

    @api.get("/{run}/tables/{table}.csv")
    def show_table(run: str, table: str) -> Response:
        """Return a table of a run's report as CSV."""
        if not TABLE_NAME.fullmatch(table):
            raise HTTPException(404, "this is not a table of a report; see the names in report/tables")
        return Response(store.report(run, f"tables/{table}.csv"), media_type="text/csv")

    @api.get("/{run}/completions")
    def list_completions(
        run: str,
        chosen: FilterQuery,
        evaluation: EvaluationQuery = None,
        offset: Annotated[int, Query(ge=0, description="Number of completions to skip.")] = 0,
        limit: Annotated[int, Query(ge=1, le=MAX_PAGE_SIZE, description="Maximum number to return.")] = 100,
    ) -> Response:
        """List completions of a run page by page, optionally only those of a prompt or kind of failure."""
        found = store.open(run, evaluation).select(chosen)
        part = [entry_data(row) for row in found[offset : offset + limit].iter_rows(named=True)]
        return _json({"total": found.height, "offset": offset, "completions": part})

    @api.get("/{run}/completions/{task:path}/{prompt}/{index}")
    def show_completion(
        run: str, task: str, prompt: int, index: int, evaluation: EvaluationQuery = None
    ) -> Response:
        """Return one completion: its program, and the robot's actions and failed checks in each world."""
        return _json(completion_details(store.open(run, evaluation), name_of((task, prompt, index))))

    return api


def _json(data: object) -> Response:
    """Encode as ASCII, because texts may contain lone surrogates, which UTF-8 cannot represent."""
    return Response(json.dumps(data), media_type="application/json", headers={"cache-control": "no-store"})


def _raise_http_errors() -> Iterator[None]:
    try:
        yield
    except MissingError as error:
        raise HTTPException(404, error.sentence) from None
    except UserError as error:
        raise HTTPException(422, str(error).encode(errors="replace").decode()) from None
