"""Invented runs for tests of reports: how many completions of each prompt pass, and why others fail."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from codebotler.simulator.settings import SimulationSettings
from made_results import VERDICT, results_of
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.report.runs import JudgedRun
from roboeval.report.writing import FIGURE_FORMATS
from roboeval.suites.load import Suite
from small_run import TASK

HOSTILE = "<script>alert('x')</script>&\"$\\frac{1}$\x1b[2J\u202e\ud800\n</pre>"
NAMES = ("Visit", "WaitForAlice", "CountMugs", "BringTea", "FindBook")
SUITE = Suite(
    "small",
    1,
    "small tasks",
    SimulationSettings(),
    {n: replace(TASK, name=n, path=Path(f"{n}.yaml")) for n in NAMES},
    "0" * 64,
)
HEAD = {"suite": SUITE.name, "digest": SUITE.digest, "python": "3.11", "codebotler": "0.1.0"}
FAILURES = (
    ("PythonError", "NameError"),
    ("PythonError", "ZeroDivisionError"),
    ("RobotExecutionError", "GoToInvalidLocation"),
    ("RobotExecutionError", "PickInvalidObject"),
    ("TaskCompletionError", "SayAtLocation"),
    ("TaskCompletionError", "InitialTerminal"),
    ("TaskCompletionError", "EventOrdering"),
)
NO_PROGRAM = (("NoProgram", "cut-off"), ("NoProgram", "tool-call"), *FAILURES)
PROGRAM = 'def task_program():\n    say("hello")\n'
UNCHECKED = pl.lit(None)
RUNS = pl.col("passed") | (pl.col("failure_class") == "TaskCompletionError")


def leave_figures_empty(patch: pytest.MonkeyPatch) -> None:
    """Let reports draw their figures but write empty files, since that takes most of their time."""
    dot = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
    files = {"svg": dot, **dict.fromkeys(FIGURE_FORMATS, b"")}
    patch.setattr("roboeval.report.writing.render", lambda _: files)


def new_run(
    name: str,
    passes: Mapping[str, tuple[int, ...]],
    *,
    of: int = 10,
    failures: Sequence[tuple[str, str]] = FAILURES,
    suite: Suite = SUITE,
    ablated: tuple[str, ...] = (),
    accepted: pl.Expr = RUNS,
    written: Callable[[int, int], Mapping[str, Any]] = lambda *_: {},
    **about: Any,  # noqa: ANN401 - `folder`, and any field of results
) -> JudgedRun:
    """Invent a run with given numbers of passing completions; the others fail by all kinds in turn.

    Args:
        name: the name of its model and, by default, of its folder.
        passes: how many completions of each prompt pass, by task.
        of: how many completions each prompt has.
        failures: classes and kinds.
        suite: the suite that judged them.
        ablated: the tasks that were also judged by common sense only.
        accepted: whether the check accepts a completion; null if there was no check.
        written: further fields of a completion, by prompt and index.
        about: the name of the `folder`, and fields of the results.
    """
    rows = [
        _row(task, prompt, index, failures, passed=index < passed)
        for task, prompts in passes.items()
        for prompt, passed in enumerate(prompts)
        for index in range(of)
    ]
    return run_of_rows(name, rows, suite=suite, ablated=ablated, accepted=accepted, written=written, **about)


def run_of_rows(
    name: str,
    rows: list[dict[str, Any]],
    *,
    suite: Suite = SUITE,
    ablated: tuple[str, ...] = (),
    accepted: pl.Expr = RUNS,
    written: Callable[[int, int], Mapping[str, Any]] = lambda *_: {},
    folder: str = "",
    model: str | None = "",
    **fields: Any,  # noqa: ANN401 - fields of results
) -> JudgedRun:
    """Invent a run of some rows; see `new_run`."""
    model = name if model == "" else model
    completions = [
        Completion.of(
            {key: row[key] for key in ("task", "prompt", "index")}
            | {"program": PROGRAM, "model": model, **written(row["prompt"], row["index"])}
        )
        for row in rows
    ]
    results = replace(
        results_of(rows, suite, completions=completions, head={**HEAD, "suite": suite.name}),
        run=RunFolder(Path(folder or name.partition("<")[0] or "hostile")),
        **fields,
    )
    alone = [row for row in rows if row["task"] in ablated]
    return JudgedRun(
        results,
        results.table.with_columns(accepted=accepted.cast(pl.Boolean)),
        ablated=results_of(alone, suite, ablated=True) if alone else None,
        name=name,
    )


def _row(
    task: str, prompt: int, index: int, failures: Sequence[tuple[str, str]], *, passed: bool
) -> dict[str, Any]:
    row = {"task": task, "prompt": prompt, "index": index, "passed": passed}
    if passed:
        return row
    name, kind = failures[(index + 3 * prompt) % len(failures)]
    check = f"{kind.lower()}()" if name == "TaskCompletionError" else None
    verdict = {
        **VERDICT,
        "world": "somebody is in",
        "satisfied": False,
        "status": "finished" if check else "robot-error" if name.startswith("Robot") else "python-error",
        "error": None if check else {"kind": kind, "message": f"{kind} it is"},
        "line": 1,
        "failed_checks": [check] if check else [],
    }
    return row | {
        "failure": {"class": name, "kind": kind, "world": 0, "check": check},
        "verdicts": [verdict],
    }


def usual() -> list[JudgedRun]:
    """Invent three models of different strength, one of them also judged under ablation."""
    strong = {"Visit": (10, 10, 9), "WaitForAlice": (10, 4, 10), "CountMugs": (8, 7, 9), "BringTea": (10,)}
    middle = {"Visit": (8, 5, 9), "WaitForAlice": (1, 0, 3), "CountMugs": (4, 4, 4), "BringTea": (2,)}
    weak = {"Visit": (3, 0, 1), "WaitForAlice": (0, 0, 0), "FindBook": (0, 1)}
    return [
        new_run("strong", strong, ablated=("Visit", "CountMugs")),
        new_run("middle", middle),
        new_run("weak", weak),
    ]


@cache
def cases() -> dict[str, list[JudgedRun]]:
    """Invent runs that have broken figures before."""
    one = new_run("one", {"Visit": (4,)})
    many = [
        new_run(
            f"model {n}", {task: ((n + i) % 11, n % 7) for i, task in enumerate(NAMES)}, ablated=("Visit",)
        )
        for n in range(40)
    ]
    return {
        "usual": usual(),
        "one prompt": [one],
        "one completion": [new_run("one", {"Visit": (0,)}, of=1)],
        "no failures": [new_run("perfect", {"Visit": (10, 10), "CountMugs": (10,)})],
        "all failures": [new_run("hopeless", {"Visit": (0, 0), "CountMugs": (0,)}, accepted=UNCHECKED)],
        "unfinished": [unfinished(one, 500), *usual()[:1]],
        "without programs": [new_run("cut off", {"Visit": (2, 4), "CountMugs": (3,)}, failures=NO_PROGRAM)],
        "40 models": many,
        "long names": [
            new_run(f"openai-chat:somebody/model-34b-hf-{n}", {"Visit": (n, 5)}) for n in range(7)
        ],
        "hostile": [new_run(HOSTILE, {"Visit": (4, 5)})],
    }


def unfinished(run: JudgedRun, total: int) -> JudgedRun:
    """Return the same run with this total of completions to judge."""
    (task, prompt, _), last = list(run.results.completions.items())[-1]
    more = {(task, prompt, index): replace(last, index=index) for index in range(1_000, total + 990)}
    completions = {**run.results.completions, **more}
    return replace(run, results=replace(run.results, completions=completions))
