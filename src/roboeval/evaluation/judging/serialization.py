"""Serializes verdicts as JSON for rows, whose size is limited."""

from __future__ import annotations

import hashlib
import json
from bisect import bisect_right
from collections.abc import Mapping
from typing import Any

from codebotler.core.files import to_line
from codebotler.core.trace import outcome_data
from roboeval.evaluation.judging.failures import (
    AGENT_ERROR_CLASS,
    NO_PROGRAM_CLASS,
    Verdict,
    failure_of_verdicts,
)
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.endings import NO_CALL
from roboeval.evaluation.runs.traces import circumstances, first_events

ROW_BYTES = 1_000_000  # limit for a row, unless it has very many worlds
WORLD_BYTES = 20_000  # limit per world in that case
ROW_HEADER_BYTES = 2_000  # space for the key and the hash
SEPARATOR_BYTES = 2  # the separator between two verdicts

FAILED_PREFIX = b'{"passed": false, '  # how `judgement` starts a failed judgement


def add_reply_fault(completion: Completion, judgement_json: bytes) -> bytes:
    """Set the failure of a failed judgement if the reply contained no program or the agent called no skill.

    This replaces the error or failed check that came from running the reply. Other judgements are
    returned unchanged.
    """
    if not judgement_json.startswith(FAILED_PREFIX):
        return judgement_json
    kind: str | None = completion.no_program
    name = NO_PROGRAM_CLASS
    if completion.mission is not None and completion.mission.ending == NO_CALL:
        name, kind = AGENT_ERROR_CLASS, NO_CALL
    if kind is None:
        return judgement_json
    found = json.loads(judgement_json)
    cause = {"class": name, "kind": kind, "world": found["failure"]["world"], "check": None}
    return to_line({**found, "failure": cause}).removesuffix(b"\n")


def row_line(completion: Completion, judgement_json: bytes) -> bytes:
    """Return a completion's row as a line of JSON: its key, its program's hash, and its judgement."""
    identity = {
        "task": completion.task,
        "prompt": completion.prompt,
        "index": completion.index,
        "program_sha256": completion.program_sha256,
        **({} if completion.mission is None else {"mission_world": completion.mission.world}),
    }
    return b"%b, %b\n" % (to_line(identity).removesuffix(b"}\n"), judgement_json.removeprefix(b"{"))


def judgements_for(verdicts: list[Verdict], prompts: int) -> tuple[bytes, ...]:
    """Return the judgement for each of `prompts` prompts, as JSON. Equal judgements share one object."""
    known_judgements: list[tuple[list[Verdict], bytes]] = []
    chosen = []
    for prompt in range(prompts):
        asked = [verdict.on(prompt) for verdict in verdicts]
        known = next((data for others, data in known_judgements if others == asked), None)
        if known is None:
            known = judgement(asked)
            known_judgements.append((asked, known))
        chosen.append(known)
    return tuple(chosen)


def judgement(verdicts: list[Verdict]) -> bytes:
    """Return `passed`, `failure` and the `verdicts` of all worlds as JSON that fits into a row."""
    why = failure_of_verdicts(verdicts)
    data = [verdict_data(verdict) for verdict in verdicts]
    return limit_size({"passed": why is None, "failure": why, "verdicts": data})


def verdict_data(verdict: Verdict) -> dict[str, Any]:
    """Convert the verdict in one world to an entry of `verdicts` in a row."""
    outcome = outcome_data(verdict.outcome)
    return {
        "world": verdict.world,
        "satisfied": verdict.satisfied,
        **{name: value for name, value in outcome.items() if name != "trace"},
        "failed_checks": [requirement.text for requirement in verdict.failed],
        "trace": outcome["trace"],
        **circumstances(verdict.outcome.trace),
    }


def limit_size(judgement: Mapping[str, Any]) -> bytes:
    """Return a judgement as JSON. If it is too long for a row, cut long traces to equal shares of it."""
    whole = _json(judgement)
    verdicts = judgement["verdicts"]
    most = max(ROW_BYTES, WORLD_BYTES * len(verdicts)) - ROW_HEADER_BYTES
    if not verdicts or len(whole) < most:
        return whole
    left = most - len(_json({**judgement, "verdicts": []}))
    share = left // len(verdicts) - SEPARATOR_BYTES
    return _json({**judgement, "verdicts": [_within(share, verdict) for verdict in verdicts]})


def _within(share: int, verdict: dict[str, Any]) -> dict[str, Any]:
    """Return a verdict with as many of the first events as fit."""
    if len(_json(verdict)) <= share:
        return verdict
    trace = verdict["trace"]
    digest = hashlib.sha256(_json(trace)).hexdigest()

    def cut(kept: int) -> dict[str, Any]:
        return {**first_events(verdict, kept), "cut": {"events": len(trace) - kept, "sha256": digest}}

    too_many = bisect_right(range(len(trace)), share, key=lambda kept: len(_json(cut(kept))))
    return cut(max(0, too_many - 1))


def _json(data: object) -> bytes:
    return to_line(data).removesuffix(b"\n")
