"""The completions of a run that were requested, exist and were judged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from roboeval.evaluation.requests import batches
from roboeval.evaluation.runs.completions import Completion, how_many
from roboeval.suites.load import Suite


@dataclass(frozen=True)
class Coverage:
    """How many completions a result covers, and how many it should."""

    judged: int
    there: int  # in the run now
    requested: int | None = None  # None if it was not recorded

    @property
    def total(self) -> int:
        """How many completions the result should cover."""
        return max(self.there, self.requested or 0)

    @property
    def is_whole(self) -> bool:
        """Whether it covers all of them."""
        return self.judged == self.total

    def __str__(self) -> str:
        """Format it, such as `3,900 of 4,000 completions (50 missing, 50 not judged)`."""
        if self.judged > self.total:
            return f"{how_many(self.judged)}, of which only {self.there:,} are still in the run"
        lacks = {"missing": self.total - self.there, "not judged": self.there - self.judged}
        said = ", ".join(f"{count:,} {what}" for what, count in lacks.items() if count > 0)
        return f"{self.judged:,} of {how_many(self.total)}{f' ({said})' if said else ''}"


@dataclass(frozen=True)
class JudgingScope:
    """The completions to judge."""

    completions: Mapping[str, int]  # by task, also of tasks that are not selected
    tasks: frozenset[str] | None = None  # selected tasks; None for all
    models: frozenset[str | None] = frozenset()  # of selected tasks; None: not recorded
    requested: Mapping[str, int] | None = None  # by task, from run.json
    cut_off: int = 0  # replies for selected tasks that ended at the limit of tokens
    limit: int | None = None  # this limit, in tokens, if it was set

    @classmethod
    def of(
        cls,
        completions: Iterable[Completion],
        tasks: frozenset[str] | None,
        about: Mapping[str, Any] = {},
        suite: Suite | None = None,
    ) -> JudgingScope:
        """Count completions of selected tasks, None for all, given run.json and the suite."""
        counts: Counter[str] = Counter()
        models: set[str | None] = set()
        cut_off = 0
        for completion in completions:
            counts[completion.task] += 1
            if tasks is None or completion.task in tasks:
                models.add(completion.model)
                cut_off += completion.is_cut_off
        requested = requested_of(about, suite)
        return cls(counts, tasks, frozenset(models), requested, cut_off, limit_of(about))

    @property
    def total(self) -> int:
        """The number of completions to judge."""
        return sum(n for task, n in self.completions.items() if self.selects(task))

    def selects(self, task: str) -> bool:
        """Whether a task is selected."""
        return self.tasks is None or task in self.tasks

    def coverage(self, judged: int, task: str | None = None) -> Coverage:
        """Return the coverage for a number of judged completions, of all selected tasks or of one."""
        if task is not None:
            requested = None if self.requested is None else self.requested.get(task, 0)
            return Coverage(judged, self.completions.get(task, 0), requested)
        if self.requested is None:
            return Coverage(judged, self.total)
        return Coverage(judged, self.total, sum(n for one, n in self.requested.items() if self.selects(one)))


def requested_of(about: Mapping[str, Any], suite: Suite | None) -> dict[str, int] | None:
    """Return how many completions of each task were requested; None if it was not recorded."""
    each = requested_of_prompts(about, suite)
    if each is None or suite is None:
        return None
    return {name: count * len(suite.tasks[name].prompts) for name, count in each.items()}


def requested_of_prompts(about: Mapping[str, Any], suite: Suite | None) -> dict[str, int] | None:
    """Return how many completions of each prompt of a task were requested; None if it was not recorded."""
    found = batches(about)
    if not found or suite is None:
        return None
    each: Counter[str] = Counter()
    for batch in found:
        tasks, count = batch.get("tasks"), batch.get("num_completions")
        if type(count) is not int:
            return None
        each |= Counter(dict.fromkeys(tasks if isinstance(tasks, list) else suite.tasks, count))
    return {name: count for name, count in each.items() if name in suite.tasks}


def limit_of(about: Mapping[str, Any]) -> int | None:
    """Return the limit of tokens in a run.json; None if it has none."""
    settings = about.get("settings")
    limit = settings.get("max_tokens") if isinstance(settings, dict) else None
    return limit if type(limit) is int else None


# --- cut-off replies

MAX_CUT_OFF_SHARE = 0.02  # share of replies that may be cut off without a warning


@dataclass(frozen=True)
class CutOff:
    """The replies of a run that ended at the limit of tokens."""

    replies: int  # also with a complete program
    without_program: int  # of these
    of: int
    limit: int | None

    @property
    def share(self) -> float:
        """Their share of all replies."""
        return self.replies / self.of if self.of else 0.0

    @property
    def warning(self) -> str | None:
        """A warning with a remedy; None if few replies were cut off."""
        if self.share <= MAX_CUT_OFF_SHARE:
            return None
        at = "the model's own limit" if self.limit is None else f"{self.limit:,} tokens"
        how = "set" if self.limit is None else "raise or leave out"
        whole = self.replies - self.without_program
        return (
            f"{self.replies:,} of {self.of:,} replies ({self.share:.1%}) were cut off at {at}, "
            f"{whole:,} of them after a whole program; {how} --max-tokens"
        )
