"""Runs over HTTP: which there are, each with its prompts, and their completions with their verdicts."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Depends, HTTPException, Query
from fastapi.responses import Response

from codebotler.badinput import BadInput
from roboeval.web.followed import FollowedRun, GoneError
from roboeval.web.seen import Seen, Wanted
from roboeval.web.shelf import Shelf
from roboeval.web.telling import completion_told, entry_data, order_of, run_data, summary_data

MOST = 1_000
"""Completions that are given at once."""

Evaluation = Annotated[
    str | None,
    Query(max_length=200, description="Which evaluation; by default the first that requires everything."),
]


@dataclass(frozen=True)
class Choice:
    """Which completions somebody asks for, as the address says it."""

    task: Annotated[str | None, Query(description="Only of this task.")] = None
    prompt: Annotated[int | None, Query(ge=0, description="Only of this prompt, counted from 0.")] = None
    passed: Annotated[bool | None, Query(description="Only those that passed, or those that failed.")] = None
    failure: Annotated[str | None, Query(description="Only those that failed by this class.")] = None
    kind: Annotated[str | None, Query(description="Only those that failed by this kind.")] = None

    @property
    def wanted(self) -> Wanted:
        """The same as the rest calls it."""
        return Wanted(self.task, self.prompt, self.passed, self.failure, self.kind)


def router(shelf: Shelf) -> APIRouter:
    """The addresses of the API.

    Args:
        shelf: whose runs.
    """
    api = APIRouter(prefix="/api/runs", tags=["runs"], default_response_class=Response)

    @api.get("")
    def list_runs() -> Response:
        """All runs: who wrote them, how far they have come, how many completions pass."""
        with _refusing():
            return _json([_told(shelf, name) for name in shelf.names()])

    @api.get("/{run}")
    def show_run(run: str, evaluation: Evaluation = None) -> Response:
        """One run with every prompt and every kind of failure."""
        with _refusing():
            _, seen = _opened(shelf, run, evaluation)
            return _json(summary_data(seen, shelf.suite_of(seen), shelf.evaluations(run)))

    @api.get("/{run}/completions")
    def list_completions(
        run: str,
        choice: Annotated[Choice, Depends()],
        evaluation: Evaluation = None,
        offset: Annotated[int, Query(ge=0, description="How many are passed over.")] = 0,
        limit: Annotated[int, Query(ge=1, le=MOST, description="How many are given.")] = 100,
    ) -> Response:
        """Completions of a run, of a prompt, or those that failed in some way; in order, a part of them."""
        with _refusing():
            _, seen = _opened(shelf, run, evaluation)
            found = seen.chosen(choice.wanted, order_of(shelf.suite_of(seen)))
        part = [entry_data(entry) for entry in found[offset : offset + limit]]
        return _json({"total": len(found), "offset": offset, "completions": part})

    @api.get("/{run}/completions/{task:path}/{prompt}/{index}")
    def show_completion(
        run: str, task: str, prompt: int, index: int, evaluation: Evaluation = None
    ) -> Response:
        """One completion: its program, and in each world what the robot did, what failed there, and why."""
        with _refusing():
            followed, seen = _opened(shelf, run, evaluation)
            entry = seen.by_key.get((task, prompt, index))
            if entry is None:
                raise HTTPException(404, "this run has no such completion")
            return _json(completion_told(followed, seen, entry, shelf.suite_of(seen)))

    return api


def _opened(shelf: Shelf, run: str, evaluation: str | None) -> tuple[FollowedRun, Seen]:
    followed = shelf.open(run, evaluation)
    return followed, followed.wait()


def _told(shelf: Shelf, name: str) -> dict[str, Any]:
    """A run in the list; of one that cannot be read, or that is just deleted, why."""
    try:
        _, seen = _opened(shelf, name, None)
        return run_data(seen, shelf.suite_of(seen), shelf.evaluations(name))
    except BadInput as error:
        return {"run": name, "state": "not read", "notes": [str(error)]}


def _json(data: object) -> Response:
    """In ASCII, since a text may hold half a character, which UTF-8 cannot."""
    return Response(json.dumps(data), media_type="application/json", headers={"cache-control": "no-store"})


@contextmanager
def _refusing() -> Iterator[None]:
    try:
        yield
    except GoneError as error:
        raise HTTPException(404, error.sentence) from None
    except BadInput as error:
        raise HTTPException(422, str(error).encode(errors="replace").decode()) from None
