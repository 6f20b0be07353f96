"""Runs over HTTP: which there are, each with its prompts, and their completions with their verdicts."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, TypeAlias

from fastapi import APIRouter, Depends, HTTPException, Query
from fastapi.responses import HTMLResponse, Response

from codebotler.core.errors import UserError
from roboeval.evaluation.runs.completions import name_of
from roboeval.web.run_store import MissingError, RunStore
from roboeval.web.serializers import RunList, completion_details, entry_data, run_details
from roboeval.web.snapshot import Filter

MOST = 1_000
"""Completions in one answer."""

REPORT_POLICY = (
    "sandbox allow-downloads; default-src 'none'; style-src 'unsafe-inline'; img-src data:; "
    "script-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

TABLE = re.compile(r"[\w-]{1,100}")  # names of tables, which lead nowhere else

Chosen: TypeAlias = Annotated[Filter, Depends()]
Evaluation: TypeAlias = Annotated[
    str | None,
    Query(max_length=200, description="The evaluation; by default, the first that requires everything."),
]


def router(store: RunStore, all_runs: RunList) -> APIRouter:
    """The addresses of the API."""
    api = APIRouter(prefix="/api/runs", tags=["runs"], default_response_class=Response)

    @api.get("")
    def list_runs() -> Response:
        """All runs: who wrote them, how far they have come, how many completions pass."""
        with as_http_errors():
            return _json(all_runs.data())

    @api.get("/{run}")
    def show_run(run: str, evaluation: Evaluation = None) -> Response:
        """One run with every prompt and every kind of failure."""
        with as_http_errors():
            return _json(run_details(store.open(run, evaluation)))

    _add_report(api, store)

    @api.get("/{run}/completions")
    def list_completions(
        run: str,
        chosen: Chosen,
        evaluation: Evaluation = None,
        offset: Annotated[int, Query(ge=0, description="How many to skip.")] = 0,
        limit: Annotated[int, Query(ge=1, le=MOST, description="How many to return.")] = 100,
    ) -> Response:
        """Completions of a run, of a prompt, or those that failed in some way; in order, a part of them."""
        with as_http_errors():
            found = store.open(run, evaluation).select(chosen)
        part = [entry_data(row) for row in found[offset : offset + limit].iter_rows(named=True)]
        return _json({"total": found.height, "offset": offset, "completions": part})

    @api.get("/{run}/completions/{task:path}/{prompt}/{index}")
    def show_completion(
        run: str, task: str, prompt: int, index: int, evaluation: Evaluation = None
    ) -> Response:
        """One completion: its program, and in each world what the robot did, what failed there, and why."""
        with as_http_errors():
            snapshot = store.open(run, evaluation)
            row = snapshot.row(name_of((task, prompt, index)))
            if row is None:
                raise HTTPException(404, "this run has no such completion")
            return _json(completion_details(snapshot, row))

    return api


def _add_report(api: APIRouter, store: RunStore) -> None:
    """Add the addresses of a run's report and of its tables."""

    @api.get("/{run}/report")
    def show_report(run: str) -> Response:
        """The report of a run, as `roboeval run` or `roboeval report` has written it there."""
        with as_http_errors():
            text = store.report(run)
        if text is None:
            raise HTTPException(404, "this run has no report")
        # A folder from elsewhere may hold any page in place of a report: nothing in it may run.
        headers = {"content-security-policy": REPORT_POLICY, "cache-control": "no-store"}
        return HTMLResponse(text, headers=headers)

    @api.get("/{run}/tables/{table}.csv")
    def show_table(run: str, table: str) -> Response:
        """A table of the report of a run, as CSV."""
        with as_http_errors():
            text = store.report(run, f"tables/{table}.csv") if TABLE.fullmatch(table) else None
        if text is None:
            raise HTTPException(404, "this run has no such table")
        return Response(text, media_type="text/csv")


def _json(data: object) -> Response:
    """In ASCII, since a text may hold half a character, which UTF-8 cannot."""
    return Response(json.dumps(data), media_type="application/json", headers={"cache-control": "no-store"})


@contextmanager
def as_http_errors() -> Iterator[None]:
    """Answer our own errors with a status and a sentence."""
    try:
        yield
    except MissingError as error:
        raise HTTPException(404, error.sentence) from None
    except UserError as error:
        raise HTTPException(422, str(error).encode(errors="replace").decode()) from None
