"""Converts runs and completions to plain data for the API and the pages."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Hashable, Mapping
from dataclasses import asdict
from enum import StrEnum
from typing import Any

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from roboeval.evaluation.generating.requests import batches
from roboeval.evaluation.judging.explanation import completion_data, suite_instruction
from roboeval.evaluation.runs.completions import KEY, CompletionKey, name_of, recorded_suffix
from roboeval.web.run_store import MissingError, RunStore
from roboeval.web.snapshot import CompletionFilter, Snapshot

MAX_SUITE_NAME, MAX_FAILURE_REASON = 120, 300


class RunState(StrEnum):
    """The state of a run, such as `being judged`, as the pages and the API show it."""

    READING = "being read"
    GENERATING = "being generated"
    JUDGING = "being judged"
    UNFINISHED = "unfinished"
    NOT_JUDGED = "not judged"
    JUDGED = "judged"
    EMPTY = "empty"
    UNREADABLE = "not read"


def state_of(run: Snapshot) -> RunState:
    """Return the state of a run, such as `unfinished` if a completion is missing or not judged."""
    written, coverage = len(run.results.completions), run.results.coverage
    lacks = coverage.there < coverage.total
    unjudged = run.judged < run.results.scope.total
    stages = (
        (RunState.GENERATING, run.is_written and (lacks or not written)),
        (RunState.JUDGING, run.is_written and unjudged),
        (RunState.EMPTY, run.completions.is_empty()),
        (RunState.NOT_JUDGED, not lacks and not run.judged),
        (RunState.UNFINISHED, lacks or unjudged),
    )
    return next((state for state, holds in stages if holds), RunState.JUDGED)


def run_data(run: Snapshot) -> dict[str, Any]:
    """Summarise a run for JSON, with its models, suite, progress, pass@1 and problems."""
    results, mean, coverage = run.results, run.pass_at_1, run.results.coverage
    return {
        "run": run.name,
        "models": run.models,
        "by_hand": bool(recorded_suffix(run.models)),
        "suite": (results.manifest if results.key else results.about).get("suite"),
        "evaluation": results.key,
        "evaluations": list(run.evaluations),
        "state": state_of(run),
        "read": 1.0,
        "completions": len(results.completions),
        "requested": coverage.requested,
        "judged": run.judged,
        "to_judge": coverage.there,
        "cut_off": results.scope.cut_off,
        "tasks_there": len({task for task, _, _ in results.completions}),
        "tasks_of_suite": None if run.suite is None else len(run.suite.tasks),
        "date": date_of(results.about),
        "settings": settings_text(results.about),
        "passed": run.passed,
        "pass@1": None if mean is None else asdict(mean),
        "notes": notes(run),
    }


def settings_text(about: Mapping[str, Any]) -> str:
    """Format the settings in run.json that were sent to the model, such as `temperature 0.2, top-p 0.95`."""
    settings = about.get("settings")
    how = {name: about[name] for name in ("mode", "max_turns") if name in about}
    named = {**how, **(settings if isinstance(settings, dict) else {})}.items()
    return ", ".join(
        f"{name.replace('_', '-')} {value if isinstance(value, str) else json.dumps(value)}"
        for name, value in named
        if value is not None
    )


def date_of(about: Mapping[str, Any]) -> str | None:
    """Return the time of a run's first request in ISO 8601, or None if it was not recorded."""
    began = [one.get("started") for one in batches(about)]
    return min((text for text in began if isinstance(text, str)), default=None)


def notes(run: Snapshot) -> list[str]:
    """Return warnings and remarks about a run as sentences, for example that replies were cut off."""
    results = run.results
    found = []
    if (missions := results.scope.missions_sentence) is not None:
        found.append(f"{missions[0].upper()}{missions[1:]}.")
    if (warning := results.scope.cut_off_warning) is not None:
        found.append(f"{warning}.")
    if run.judged and run.suite is None:
        name = shortened(str(results.manifest.get("suite")), MAX_SUITE_NAME)
        missing = f'The suite "{name}" was not found, so failed checks are not explained'
        found.append(f"{missing}; use `roboeval serve --suite FOLDER`.")
    elif run.judged and run.suite is not None and results.manifest.get("digest") != run.suite.digest:
        found.append("The suite has changed since this run was judged; explanations may be missing.")
    return found


class RunList:
    """Summarises the runs in a store, and updates a summary only if its run has changed."""

    def __init__(self, store: RunStore) -> None:
        self._store = store
        self._known: dict[str, tuple[Hashable, dict[str, Any]]] = {}

    def data(self, seconds: float = math.inf) -> list[dict[str, Any]]:
        """Return a summary of each run, or why it cannot be read. After `seconds`, use earlier summaries."""
        until = time.monotonic() + seconds
        return [self._run_data(name, may_read=time.monotonic() < until) for name in self._store.names()]

    def _run_data(self, name: str, *, may_read: bool) -> dict[str, Any]:
        unread = {"run": name, "state": RunState.READING, "notes": []}
        known, data = self._known.get(name, (None, unread))
        version: Hashable = None
        try:
            version = self._store.version(name)
            if not may_read or version == known:
                return data
            run = self._store.open(name)
            version, data = run.version, run_data(run)
        except UserError as error:
            data = {**unread, "state": RunState.UNREADABLE, "notes": [str(error)]}
        self._known[name] = version, data
        return data


def run_details(run: Snapshot) -> dict[str, Any]:
    """Return `run_data`, with pass@1 of each task and prompt and the number of failures of each kind."""
    means = {score.task: score.pass_at(1).mean for score in run.scores}
    tasks: dict[str, list[dict[str, Any]]] = {}
    for prompt in run.prompts(CompletionFilter(passed=True)):
        counts = {
            "prompt": prompt["prompt"],
            "instruction": suite_instruction(run.suite, prompt["task"], prompt["prompt"]),
            "completions": prompt["written"],
            "judged": prompt["judged"],
            "passed": prompt["counted"],
            "pass@1": prompt["share"],
        }
        tasks.setdefault(prompt["task"], []).append(counts)
    kinds = [(name, one) for (name, kind), one in run.failures.items() if kind is not None]
    kinds.sort(key=lambda each: (-each[1].count, each[0], each[1].name))
    return {
        **run_data(run),
        "tasks": [{"task": task, "pass@1": means.get(task), "prompts": rows} for task, rows in tasks.items()],
        "failures": [
            {"class": name, "kind": kind.name, "count": kind.count, "share": kind.share}
            for name, kind in kinds
        ],
    }


def entry_data(row: Mapping[str, Any]) -> dict[str, Any]:
    """Summarise a completion for a list, given its row in `Snapshot.completions`."""
    failure = {name: row[f"failure_{name}"] for name in ("class", "kind", "world", "check")}
    return {
        **{name: row[name] for name in (*KEY, "passed")},
        "failure": None if row["failure_class"] is None else failure,
        "why": shortened(row["why"], MAX_FAILURE_REASON),
        "worlds": row["worlds"],
    }


def completion_details(run: Snapshot, name: str) -> dict[str, Any]:
    """Return a completion with its program, and the steps, failed checks and explanations of each world."""
    row, results = run.row(name), run.results
    if row is None:
        raise MissingError(f'this run has no completion "{shortened(name, MAX_SUITE_NAME)}"')
    key: CompletionKey = row["task"], row["prompt"], row["index"]
    judged = {**entry_data(row), "verdicts": []} if row["passed"] is None else results.row(key)
    try:
        data = completion_data(judged, results.completions[key], run.suite, ablated=results.is_ablated)
    except (UserError, KeyError, TypeError, IndexError, AttributeError, ValueError):
        which = f"the row of {shortened(name_of(key), MAX_SUITE_NAME)} is damaged"
        what = f"{which}; `roboeval evaluate --redo` judges the run again"
        raise UserError(what, file=results.run.rows(results.key or "").name) from None
    if run.suite is None:
        for world in data["worlds"]:
            for check in world["failed_checks"]:
                check["explanation"] = None
    return {**data, "evaluation": results.key}
