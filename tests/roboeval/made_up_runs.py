"""Runs that nobody generated, for tests of reports: how many completions of each prompt pass, and why not."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from roboeval.evaluation.tables import RowData

from codebotler.files import to_line
from codebotler.simulator.rules import Rules
from roboeval.analysis.resample import Trial, by_prompt
from roboeval.evaluation.run import Run
from roboeval.report.reading import JudgedRun, Written, scored
from roboeval.suites.load import Suite
from seals import unseal
from small_run import TASK

HOSTILE = "<script>alert('x')</script>&\"$\\frac{1}$\x1b[2J\u202e\ud800\n</pre>"
NAMES = ("Visit", "WaitForAlice", "CountMugs", "BringTea", "FindBook")
SUITE = Suite(
    "small",
    1,
    "small tasks",
    Rules(),
    {n: replace(TASK, name=n, path=Path(f"{n}.yaml")) for n in NAMES},
    "0" * 64,
)
FAILURES = (
    ("PythonError", "NameError"),
    ("PythonError", "ZeroDivisionError"),
    ("RobotExecutionError", "GoToInvalidLocation"),
    ("RobotExecutionError", "PickInvalidObject"),
    ("TaskCompletionError", "SayAtLocation"),
    ("TaskCompletionError", "InitialTerminal"),
    ("TaskCompletionError", "EventOrdering"),
)


def made_up(
    name: str,
    passes: Mapping[str, tuple[int, ...]],
    *,
    of: int = 10,
    ablated: tuple[str, ...] = (),
    **changes: Any,  # noqa: ANN401 - any field of a run
) -> JudgedRun:
    """A run of which so many completions pass, by task and prompt; the others fail by all kinds in turn."""
    rows = [
        _row(task, prompt, index, passed=index < passed)
        for task, prompts in passes.items()
        for prompt, passed in enumerate(prompts)
        for index in range(of)
    ]
    trials = by_prompt(
        ((r["task"], r["prompt"], r["index"]), Trial(_accepted(r), _accepted(r), r["passed"])) for r in rows
    )
    run = JudgedRun(
        name=name,
        folder=name,
        model=name,
        about={},
        head={"suite": SUITE.name, "digest": SUITE.digest, "python": "3.11", "codebotler": "0.1.0"},
        rows=tuple(rows),
        written={(r["task"], r["prompt"], r["index"]): Written(PROGRAM) for r in rows},
        scores=scored(rows, SUITE),
        total=len(rows),
        ablated=scored((r for r in rows if r["task"] in ablated), SUITE) or None,
        trials=trials,
    )
    return replace(run, **changes)


PROGRAM = 'def task_program():\n    say("hello")\n'


def _accepted(row: RowData) -> bool:
    return bool(row["passed"] or row["failure"]["class"] == "TaskCompletionError")


def _row(task: str, prompt: int, index: int, *, passed: bool) -> RowData:
    name, kind = FAILURES[(index + 3 * prompt) % len(FAILURES)]
    check = None if name != "TaskCompletionError" else f"{kind.lower()}()"
    error = None if check else {"kind": kind, "message": f"{kind} it is"}
    verdict = {
        "world": "somebody is in",
        "satisfied": passed,
        "status": "finished" if check else "robot-error" if name.startswith("Robot") else "python-error",
        "error": error,
        "line": 1,
        "failed_checks": [check] if check else [],
        "trace": [],
    }
    return {
        "task": task,
        "prompt": prompt,
        "index": index,
        "passed": passed,
        "failure": None if passed else {"class": name, "kind": kind, "world": 0, "check": check},
        "verdicts": [] if passed else [verdict],
    }


def usual() -> list[JudgedRun]:
    """Three models of different strength, one of them judged under ablation too."""
    strong = {"Visit": (10, 10, 9), "WaitForAlice": (10, 4, 10), "CountMugs": (8, 7, 9), "BringTea": (10,)}
    middle = {"Visit": (8, 5, 9), "WaitForAlice": (1, 0, 3), "CountMugs": (4, 4, 4), "BringTea": (2,)}
    weak = {"Visit": (3, 0, 1), "WaitForAlice": (0, 0, 0), "FindBook": (0, 1)}
    return [
        made_up("strong", strong, ablated=("Visit", "CountMugs")),
        made_up("middle", middle),
        made_up("weak", weak),
    ]


@cache
def cases() -> dict[str, list[JudgedRun]]:
    """What has broken figures elsewhere."""
    one = made_up("one", {"Visit": (4,)})
    many = [
        made_up(
            f"model {n}", {task: ((n + i) % 11, n % 7) for i, task in enumerate(NAMES)}, ablated=("Visit",)
        )
        for n in range(40)
    ]
    return {
        "usual": usual(),
        "one prompt": [one],
        "one completion": [made_up("one", {"Visit": (0,)}, of=1)],
        "no failures": [made_up("perfect", {"Visit": (10, 10), "CountMugs": (10,)})],
        "all failures": [made_up("hopeless", {"Visit": (0, 0), "CountMugs": (0,)}, trials=None)],
        "unfinished": [replace(one, total=500), *usual()[:1]],
        "40 models": many,
        "long names": [
            made_up(f"openai-chat:somebody/model-34b-hf-{n}", {"Visit": (n, 5)}) for n in range(7)
        ],
        "hostile": [made_up(HOSTILE, {"Visit": (4, 5)})],
    }


def grown(run: Path, times: int) -> None:
    """Let a run on the disk have each of its completions so many times, with other indices."""
    found = Run(run)
    for path in (found.completions, found.rows("paper")):
        rows = [json.loads(line) for line in path.read_bytes().splitlines()]
        most = 1 + max(row["index"] for row in rows)
        with path.open("wb") as file:
            for n in range(times):
                file.writelines(to_line({**row, "index": row["index"] + n * most}) for row in rows)
    unseal(run)
    hashes = found.programs("paper")
    hashes.write_bytes(hashes.read_bytes() * times)
