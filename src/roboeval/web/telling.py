"""What the pages and the API tell of a run, as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Any

from codebotler.badinput import BadInput
from codebotler.terminal import shortened
from roboeval.evaluation.completions import how_many, name_of
from roboeval.evaluation.explanation import GONE, completion_data
from roboeval.evaluation.failures import CLASSES
from roboeval.evaluation.tables import by_hand
from roboeval.suites.load import ABLATED, Suite
from roboeval.web.followed import FollowedRun
from roboeval.web.seen import Cell, Entry, Seen, Wanted
from roboeval.web.shelf import unknown_suite

MOST_TOLD = 120


class State(StrEnum):
    """How far a run has come."""

    READING = "being read"
    GENERATING = "being generated"
    JUDGING = "being judged"
    UNFINISHED = "unfinished"
    NOT_JUDGED = "not judged"
    JUDGED = "judged"
    EMPTY = "empty"
    DAMAGED = "damaged"


def state_of(seen: Seen, wanted: int | None) -> State:
    """How far a run has come.

    Args:
        seen: what is known of it.
        wanted: how many completions it shall have; None where nobody said so.
    """
    lacks = wanted is not None and seen.written_count < wanted
    unjudged = len(seen.judged) < seen.to_judge
    stages = (
        (State.READING, seen.share < 1),
        (State.GENERATING, seen.is_written and (lacks or not seen.written_count)),
        (State.JUDGING, seen.is_written and unjudged),
        (State.DAMAGED, seen.fault_count > 0),
        (State.EMPTY, not seen.entries),
        (State.NOT_JUDGED, not lacks and not seen.judged),
        (State.UNFINISHED, lacks or unjudged),
    )
    return next((state for state, holds in stages if holds), State.JUDGED)


def wanted_count(seen: Seen, suite: Suite | None) -> int | None:
    """How many completions a run shall have; None where nobody said so."""
    each, tasks = seen.about.get("num_completions"), seen.about.get("tasks")
    if not isinstance(each, int) or suite is None:
        return None
    chosen = suite.tasks if not isinstance(tasks, list) else [name for name in tasks if name in suite.tasks]
    return each * sum(len(suite.tasks[name].prompts) for name in chosen)


def run_data(seen: Seen, suite: Suite | None, evaluations: Sequence[str]) -> dict[str, Any]:
    """A run in short.

    Args:
        seen: what is known of it.
        suite: by which it was judged; None if it is not at hand.
        evaluations: the names of all its evaluations.
    """
    wanted = wanted_count(seen, suite)
    mean = seen.mean
    models = [model for model in seen.models if model is not None]
    return {
        "run": seen.name,
        "models": models,
        "by_hand": bool(by_hand(models)),
        "suite": seen.head.get("suite") if seen.key else seen.about.get("suite"),
        "evaluation": seen.key,
        "evaluations": list(evaluations),
        "state": state_of(seen, wanted),
        "read": seen.share,
        "completions": seen.written_count,
        "wanted": wanted,
        "judged": len(seen.judged),
        "to_judge": seen.to_judge,
        "passed": seen.passed_count,
        "pass@1": None if mean is None else {"mean": mean.mean, "low": mean.low, "high": mean.high},
        "notes": notes(seen, suite),
    }


def notes(seen: Seen, suite: Suite | None) -> list[str]:
    """What is amiss with a run, in sentences."""
    told = list(seen.faults)
    if seen.fault_count > len(told):
        told.append(f"{seen.fault_count - len(told):,} more lines are damaged.")
    if told:
        told.append("The other rows are shown.")
    if seen.stale_count:
        changed = f"{how_many(seen.stale_count)} changed since the verdict"
        told.append(f"{changed}; `roboeval evaluate` with --redo judges anew.")
    if seen.judged and suite is None:
        name = shortened(str(seen.head.get("suite")), MOST_TOLD)
        told.append(
            f'The suite "{name}" is not at hand, so that failed checks cannot be explained; '
            "`roboeval serve --suite FOLDER` names it."
        )
    elif seen.judged and suite is not None and seen.head.get("digest") != suite.digest:
        told.append("The suite has changed since this run was judged; explanations may be missing.")
    return told


def summary_data(seen: Seen, suite: Suite | None, evaluations: Sequence[str]) -> dict[str, Any]:
    """A run with its tasks, prompts and kinds of failures."""
    judged = len(seen.judged)
    scores = {score.task: score for score in seen.scores(order_of(suite))}
    tasks: dict[str, list[dict[str, Any]]] = {}
    for cell in seen.cells(Wanted(passed=True), order_of(suite)):
        tasks.setdefault(cell.task, []).append(_prompt_data(cell, suite))
    return {
        **run_data(seen, suite, evaluations),
        "tasks": [
            {
                "task": task,
                "pass@1": scores[task].pass_at(1).mean if task in scores else None,
                "prompts": prompts,
            }
            for task, prompts in tasks.items()
        ],
        "failures": [
            {"class": failure_class, "kind": kind, "count": count, "share": count / judged}
            for (failure_class, kind), count in seen.kinds.items()
        ],
    }


def _prompt_data(cell: Cell, suite: Suite | None) -> dict[str, Any]:
    task = suite.tasks.get(cell.task) if suite is not None else None
    known = task is not None and cell.prompt < len(task.prompts)
    return {
        "prompt": cell.prompt,
        "instruction": task.prompts[cell.prompt] if task is not None and known else None,
        "completions": cell.written,
        "judged": cell.judged,
        "passed": cell.counted,
        "pass@1": cell.share,
    }


def order_of(suite: Suite | None) -> tuple[str, ...]:
    """The tasks in the order of their suite."""
    return () if suite is None else tuple(suite.tasks)


def classes_of(seen: Seen) -> list[tuple[str, int, list[tuple[str, int]]]]:
    """How many failed by each class, and of each by which kinds, most frequent first."""
    names = dict.fromkeys([*CLASSES, *(name for name, _ in seen.kinds)])
    found = []
    for name in names:
        kinds = [(kind, count) for (of, kind), count in seen.kinds.items() if of == name]
        if kinds:
            found.append((name, sum(count for _, count in kinds), kinds))
    return found


def entry_data(entry: Entry) -> dict[str, Any]:
    """A completion in short."""
    task, prompt, index = entry.key
    judged = entry.judged
    told: dict[str, Any] = {"task": task, "prompt": prompt, "index": index}
    if judged is None:
        return {**told, "passed": None, "failure": None, "why": "", "worlds": "", "stale": entry.stale}
    failure = {
        "class": judged.failure_class,
        "kind": judged.kind,
        "world": judged.world,
        "check": judged.check,
    }
    return {
        **told,
        "passed": judged.passed,
        "failure": None if judged.failure_class is None else failure,
        "why": judged.why,
        "worlds": judged.worlds,
        "stale": entry.stale,
    }


def completion_told(run: FollowedRun, seen: Seen, entry: Entry, suite: Suite | None) -> dict[str, Any]:
    """A completion with its program, and with each world's steps, failed checks and explanations.

    Args:
        run: in which it is.
        seen: what is known of the run.
        entry: which completion.
        suite: by which it was judged; None if it is not at hand.

    Raises:
        BadInput: it does not stand in the run any more, or its row is damaged.
    """
    completion, row = run.completion(entry), run.row(entry)
    keep = {"evaluation": seen.key, "stale": entry.stale, "note": GONE if entry.stale else None}
    if row is None:
        names = () if completion is None else ("model", "instruction", "program")
        known = {name: getattr(completion, name) for name in names}
        return {**entry_data(entry), **known, **keep, "worlds": []}
    judged_by = suite or unknown_suite(str(seen.head.get("suite")))
    ablated = bool(seen.key and seen.key.endswith(ABLATED))
    try:
        told = completion_data(row, completion, judged_by, ablated=ablated)
    except (BadInput, KeyError, TypeError, IndexError, AttributeError, ValueError):
        what = f"the row of {shortened(name_of(entry.key), MOST_TOLD)} is damaged; --redo judges it again"
        raise BadInput(what, file=run.run.rows(seen.key or "").name) from None
    if suite is None:
        for world in told["worlds"]:
            for check in world["failed_checks"]:
                check["explanation"] = None
    return {**told, **keep}


def is_same_suite(first: Mapping[str, Any], second: Mapping[str, Any]) -> bool:
    """Whether two runs were judged alike, so that their numbers may be compared."""
    return all(first.get(part) == second.get(part) for part in ("suite", "digest", "ablation"))
