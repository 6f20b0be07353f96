"""Counts how many completions of a run were requested, exist, and were judged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from roboeval.evaluation.generating.requests import batches
from roboeval.evaluation.runs.completions import Completion, how_many
from roboeval.suites.load import Suite

MAX_CUT_OFF_SHARE = 0.02  # share of replies that may be cut off without a warning


@dataclass(frozen=True)
class Coverage:
    """The number of completions that a result covers, and the number that it should cover."""

    judged: int
    there: int  # completions now in the run
    requested: int | None = None  # requested completions, or None if that was not recorded

    @property
    def total(self) -> int:
        """Return the number of completions that the result should cover."""
        return max(self.there, self.requested or 0)

    @property
    def is_whole(self) -> bool:
        """Whether the result covers all completions that it should cover."""
        return self.judged == self.total

    def __str__(self) -> str:
        """Format the coverage, such as `3,900 of 4,000 completions (50 missing, 50 not judged)`."""
        lacks = {"missing": self.total - self.there, "not judged": self.there - self.judged}
        said = ", ".join(f"{count:,} {what}" for what, count in lacks.items() if count > 0)
        return f"{self.judged:,} of {how_many(self.total)}{f' ({said})' if said else ''}"


@dataclass(frozen=True)
class JudgingScope:
    """Counts the completions that an evaluation should judge, by task and by how they ended."""

    completions: Mapping[str, int]  # the number for each task, selected or not
    tasks: frozenset[str] | None = None  # selected tasks; None for all
    models: frozenset[str | None] = frozenset()  # models used for the selected tasks; None if not recorded
    requested: Mapping[str, int] | None = None  # requested completions of each task, from run.json
    cut_off: int = 0  # replies for selected tasks that ended at the token limit
    limit: int | None = None  # the token limit, if it was set
    endings: Mapping[str, int] = field(default_factory=dict)  # the number of missions by ending
    turns: int = 0  # replies in all missions

    @classmethod
    def of(
        cls,
        completions: Iterable[Completion],
        tasks: frozenset[str] | None,
        about: Mapping[str, Any] = {},
        suite: Suite | None = None,
    ) -> JudgingScope:
        """Count completions by task, and missions and cut-off replies of the selected `tasks` (None: all)."""
        every = list(completions)
        selected = [one for one in every if tasks is None or one.task in tasks]
        missions = [(one.mission.ending, one.turns) for one in selected if one.mission is not None]
        settings = about.get("settings")
        limit = settings.get("max_tokens") if isinstance(settings, dict) else None
        return cls(
            completions=Counter(one.task for one in every),
            tasks=tasks,
            models=frozenset(one.model for one in selected),
            requested=requested_of(about, suite),
            cut_off=sum(one.is_cut_off for one in selected),
            limit=limit if type(limit) is int else None,
            endings=Counter(ending for ending, _ in missions),
            turns=sum(turns for _, turns in missions),
        )

    @property
    def total(self) -> int:
        """Return the number of completions of the selected tasks."""
        return sum(n for task, n in self.completions.items() if self.selects(task))

    def selects(self, task: str) -> bool:
        """Return whether a task is selected."""
        return self.tasks is None or task in self.tasks

    @property
    def missions_sentence(self) -> str | None:
        """A sentence about the turns and endings of agent missions, or None if there are no missions."""
        if not (count := sum(self.endings.values())):
            return None
        ended = ", ".join(f"{ending} {number:,}" for ending, number in Counter(self.endings).most_common())
        turns = f"{self.turns / count:.1f} turns on average"
        return f"each completion is one mission in one world: {turns}; how they ended: {ended}"

    @property
    def cut_off_warning(self) -> str | None:
        """Return a warning if more than 2% of the replies ended at the token limit, or else None."""
        share = self.cut_off / self.total if self.total else 0.0
        if share <= MAX_CUT_OFF_SHARE:
            return None
        at = "the model's own limit" if self.limit is None else f"{self.limit:,} tokens"
        replies = f"{self.cut_off:,} of {self.total:,} replies ({share:.1%})"
        return f"{replies} were cut off at {at}; see --max-tokens"

    def coverage(self, judged: int, task: str | None = None) -> Coverage:
        """Return the coverage of a task or of all selected tasks, given the number of judged completions."""
        if task is not None:
            requested = None if self.requested is None else self.requested.get(task, 0)
            return Coverage(judged, self.completions.get(task, 0), requested)
        if self.requested is None:
            return Coverage(judged, self.total)
        return Coverage(judged, self.total, sum(n for one, n in self.requested.items() if self.selects(one)))


def requested_of(about: Mapping[str, Any], suite: Suite | None) -> dict[str, int] | None:
    """Return the number of completions of each task that run.json (`about`) requests, or None if unknown."""
    found = batches(about)
    if not found or suite is None:
        return None
    each: Counter[str] = Counter()
    for batch in found:
        tasks, count = batch.get("tasks"), batch.get("num_completions")
        if type(count) is not int:
            return None
        each |= Counter(dict.fromkeys(tasks if isinstance(tasks, list) else suite.tasks, count))
    # An agent has a mission in each world.
    worlds = {name: len(task.scenarios) if "mode" in about else 1 for name, task in suite.tasks.items()}
    sizes = {name: len(task.prompts) * worlds[name] for name, task in suite.tasks.items()}
    return {name: count * sizes[name] for name, count in each.items() if name in sizes}
