"""Counts completions while they are judged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from roboeval.analysis.metrics import PromptScore, TaskScore
from roboeval.evaluation.runs.completions import CompletionKey
from roboeval.evaluation.runs.rows import Row, key_of


class Tally:
    """Counts judged, passed and failed completions."""

    def __init__(self) -> None:
        self.judged: Counter[tuple[str, int]] = Counter()  # by task and prompt
        self.passed: Counter[tuple[str, int]] = Counter()  # by task and prompt
        self.failed: Counter[tuple[str, str]] = Counter()  # by class and kind of the failure
        self.first_failed: CompletionKey | None = None

    def add(self, row: Row) -> None:
        """Count a judged completion."""
        prompt = row["task"], row["prompt"]
        self.judged[prompt] += 1
        if (why := row["failure"]) is None:
            self.passed[prompt] += 1
            return
        self.failed[why["class"], why["kind"]] += 1
        if self.first_failed is None:
            self.first_failed = key_of(row)

    def scores(self, order: Iterable[str] = ()) -> tuple[TaskScore, ...]:
        """Compute the scores of tasks and prompts (paper, section IV.C). Tasks not in `order` come last."""
        prompts: dict[str, list[PromptScore]] = {task: [] for task in order}
        for (task, prompt), n in self.judged.items():
            prompts.setdefault(task, []).append(PromptScore(task, prompt, n, self.passed[task, prompt]))
        return tuple(
            TaskScore(task, tuple(sorted(scores, key=lambda score: score.prompt)))
            for task, scores in prompts.items()
            if scores
        )
