"""Judged runs as a report reads them: each row with what it needs, and who wrote what at which cost."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from codebotler.cachedproperty import cached_property
from codebotler.terminal import visible
from roboeval.analysis.cluster import trimmed
from roboeval.analysis.metrics import TaskScore, score_by_prompt
from roboeval.analysis.resample import Prompt
from roboeval.analysis.verdict_changes import Judged
from roboeval.evaluation.completions import Completion, Key
from roboeval.evaluation.evaluation import Evaluation
from roboeval.evaluation.run import load_head
from roboeval.evaluation.tables import RowData
from roboeval.suites.load import Suite

MOST = 10**12  # tokens or seconds; a request of which more is told was not counted
LONGEST_NAME = 100


@dataclass(frozen=True)
class Written:
    """What a report needs of a completion.

    Args:
        program: its source.
        instruction: what the model was told; None where nobody recorded it.
        input_tokens: that the request took; None where nobody counted.
        output_tokens: that the reply took; None where nobody counted.
        seconds: from the request to the reply; None where nobody measured.
    """

    program: str
    instruction: str | None = None
    input_tokens: int | None = None
    output_tokens: int | None = None
    seconds: float | None = None


@dataclass(frozen=True)
class JudgedRun:
    """A run with its verdicts.

    Args:
        name: as figures and tables call it; no two runs of a report share it.
        folder: the name of its folder.
        model: who wrote the completions; None where nobody recorded it, or several wrote them.
        about: what run.json says.
        head: by what it was judged.
        rows: of the evaluation; of their verdicts only that of the world that decided keeps its trace.
        written: the completions by key.
        scores: in the order of the suite.
        total: how many completions there are to judge.
        ablated: scores where only common sense is required; None where nobody judged that.
        trials: its completions as the check sees them; None where they were not checked.
        beside: the same as another suite judges it; None where nobody asked for that.
        is_mixed: whether several models wrote the completions.
    """

    name: str
    folder: str
    model: str | None
    about: Mapping[str, Any]
    head: Mapping[str, Any]
    rows: tuple[RowData, ...]
    written: Mapping[Key, Written]
    scores: tuple[TaskScore, ...]
    total: int
    ablated: tuple[TaskScore, ...] | None = None
    trials: tuple[Prompt, ...] | None = None
    beside: Judged | None = None
    is_mixed: bool = False

    @cached_property
    def by_prompt(self) -> dict[tuple[str, int], float]:
        """pass@1 of each prompt."""
        return {(p.task, p.prompt): p.pass_at(1) for score in self.scores for p in score.prompts}

    @cached_property
    def by_task(self) -> dict[str, list[float]]:
        """pass@1 of the prompts of each task."""
        return {score.task: [p.pass_at(1) for p in score.prompts] for score in self.scores}

    @cached_property
    def instructions(self) -> dict[tuple[str, int], str]:
        """What the model was told for each prompt, where that was recorded."""
        return {key[:2]: w.instruction for key, w in self.written.items() if w.instruction is not None}

    @property
    def failed(self) -> list[RowData]:
        """The rows that failed."""
        return [row for row in self.rows if not row["passed"]]


def read_run(evaluation: Evaluation, rows: Iterable[RowData], suite: Suite) -> JudgedRun:
    """Read a judged run.

    Args:
        evaluation: that lies in it.
        rows: of that, read once.
        suite: by which it was judged.

    Raises:
        BadInput: one of its files is wrong.
    """
    kept = tuple({**trimmed(row), "task": sys.intern(row["task"])} for row in rows)
    about = load_head(evaluation.run.about) if evaluation.run.about.exists() else {}
    models: set[str | None] = set()
    written: dict[Key, Written] = {}
    for completion in evaluation.judged():
        models.add(completion.model)
        key = sys.intern(completion.task), completion.prompt, completion.index
        written[key] = _written(completion)
    folder = evaluation.run.path.resolve().name
    is_mixed = len(models) > 1
    model = None if is_mixed or not models else models.pop()
    return JudgedRun(
        name=_readable(model or folder),
        folder=folder,
        model=model,
        about=about,
        head=evaluation.head,
        rows=kept,
        written=written,
        scores=scored(kept, suite),
        total=evaluation.scope.total,
        is_mixed=is_mixed,
    )


def _readable(name: str) -> str:
    """A name as text that a line holds: its beginning and its end, by which names are told apart."""
    name = visible(name)
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 30]}…{name[-29:]}"


def scored(rows: Iterable[RowData], suite: Suite) -> tuple[TaskScore, ...]:
    """The scores of tasks, in the order of the suite."""
    scores = score_by_prompt((row["task"], row["prompt"], row["passed"]) for row in rows)
    by_name = {score.task: score for score in scores}
    return tuple(by_name[name] for name in dict.fromkeys([*suite.tasks, *by_name]) if name in by_name)


def _written(completion: Completion) -> Written:
    usage = completion.more.get("usage")
    usage = usage if isinstance(usage, dict) else {}
    instruction = completion.instruction
    return Written(
        program=completion.program,
        instruction=None if instruction is None else sys.intern(instruction),
        input_tokens=_whole(usage.get("input_tokens")),
        output_tokens=_whole(usage.get("output_tokens")),
        seconds=_number(completion.more.get("latency_s")),
    )


def _whole(value: object) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MOST else None


def _number(value: object) -> float | None:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    return float(value) if 0 <= value <= MOST else None


def named_apart(runs: Sequence[JudgedRun]) -> list[JudgedRun]:
    """The same runs, named so that no two share a name: by folder too where the model does not tell."""
    names = _apart([run.name for run in runs], [f"{run.name} ({run.folder})" for run in runs])
    while len({*names}) < len(names):
        names = _apart(names, [f"{name} #{number}" for number, name in enumerate(names, 1)])
    return [replace(run, name=name) for run, name in zip(runs, names, strict=True)]


def _apart(names: Sequence[str], longer: Sequence[str]) -> list[str]:
    counts = Counter(names)
    return [long if counts[name] > 1 else name for name, long in zip(names, longer, strict=True)]
