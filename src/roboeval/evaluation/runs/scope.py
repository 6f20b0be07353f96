"""What there is to judge in a run, beside what has been judged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from roboeval.evaluation.runs.completions import Completion


@dataclass(frozen=True)
class Scope:
    """What there is to judge."""

    completions: Mapping[str, int]  # by task, also of tasks that were not selected
    tasks: frozenset[str] | None = None  # those selected; None for all
    models: frozenset[str | None] = frozenset()  # of the selected; None: not recorded

    @classmethod
    def of(cls, completions: Iterable[Completion], tasks: frozenset[str] | None) -> Scope:
        """Count completions, in one pass."""
        counts: Counter[str] = Counter()
        models: set[str | None] = set()
        for completion in completions:
            counts[completion.task] += 1
            if tasks is None or completion.task in tasks:
                models.add(completion.model)
        return cls(counts, tasks, frozenset(models))

    @property
    def total(self) -> int:
        """How many completions there are to judge."""
        return sum(n for task, n in self.completions.items() if self.selects(task))

    def selects(self, task: str) -> bool:
        """Whether to judge a task."""
        return self.tasks is None or task in self.tasks
