"""How large a row of an evaluation may be; of traces that do not fit, the beginning is kept, and a hash."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

from codebotler.files import to_line
from roboeval.evaluation.completions import Judgement

MOST = 1_000_000  # bytes of a row
MOST_OF_WORLD = 20_000  # for each world, where there are so many that they come to more
NAMES = 2_000  # of a row's bytes are left for its completion: the task's name is that of a file
BETWEEN = 2  # bytes between two events
HASH = "0" * 64


def bounded(told: Judgement) -> Judgement:
    """A judgement that fits into a row, with traces cut where they must be; a shorter one as it is.

    Each world has an equal share of the bytes. Of a trace that takes more, `cut` says how many events are
    left out, and the SHA-256 of the JSON of all of it.

    Args:
        told: with whole traces.
    """
    verdicts = told["verdicts"]
    most = max(MOST, MOST_OF_WORLD * len(verdicts)) - NAMES
    if not verdicts or len(to_line(told)) <= most:
        return told
    bare = [{**verdict, "trace": [], "cut": _cut(verdict["trace"], HASH)} for verdict in verdicts]
    share = (most - len(to_line({**told, "verdicts": bare}))) // len(verdicts)
    return {**told, "verdicts": [_within(share, verdict) for verdict in verdicts]}


def _within(share: int, verdict: dict[str, Any]) -> dict[str, Any]:
    trace = verdict["trace"]
    size = 0
    for kept, event in enumerate(trace):
        size += len(_json(event)) + BETWEEN
        if size > share:
            whole = hashlib.sha256(_json(trace)).hexdigest()
            return {**verdict, "trace": trace[:kept], "cut": _cut(trace[kept:], whole)}
    return verdict


def _cut(events: Sequence[object], sha256: str) -> dict[str, Any]:
    return {"events": len(events), "sha256": sha256}


def _json(data: object) -> bytes:
    return to_line(data).removesuffix(b"\n")
