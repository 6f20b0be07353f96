"""Defines the status of mutants and the mutation score of a task."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

from roboeval.mutation.mutants import Mutant, Original

MIN_RELIABLE_MUTANTS = 60  # a score from fewer mutants that change behaviour is unreliable
MAX_EQUIVALENT_SHARE = 0.15  # largest share of equivalent mutants for which the score is reliable


class MutantStatus(StrEnum):
    """Whether the checks reject a mutant (killed) or not (survived), or why it is not counted."""

    KILLED = "killed"
    SURVIVED = "survived"
    EQUIVALENT = "equivalent"
    SAME = "same traces"
    CRASHES = "crashes"


CHANGING_STATUSES = MutantStatus.KILLED, MutantStatus.SURVIVED, MutantStatus.EQUIVALENT


class MutantResult(NamedTuple):
    """The status of a mutant and the reason for it."""

    status: MutantStatus
    world: str | None = None  # the world in which it was killed
    why: str | None = None  # the failed check, the error, or why the mutant is equivalent


class TriedMutant(NamedTuple):
    """A mutant and its result."""

    mutant: Mutant
    result: MutantResult

    def row(self) -> dict[str, Any]:
        """Return the mutant's row in mutants/TASK.jsonl."""
        return {
            "operator": self.mutant.operator,
            "original": self.mutant.original.name,
            **self.result._asdict(),
            "diff": self.mutant.diff,
            "program": self.mutant.program,
        }


@dataclass(frozen=True)
class MutationScore:
    """Counts how many mutants of a task are killed by its checks."""

    task: str
    worlds: int
    right: tuple[Original, ...]
    wrong: tuple[tuple[Original, MutantResult], ...]  # originals that fail the checks of the suite
    mutants: tuple[TriedMutant, ...]

    def count(self, *statuses: MutantStatus) -> int:
        """Count the mutants with any of the given statuses."""
        return sum(one.result.status in statuses for one in self.mutants)

    @property
    def score(self) -> float | None:
        """The share of mutants that are killed, not counting equivalent ones."""
        return self._killed_of(MutantStatus.KILLED, MutantStatus.SURVIVED)

    @property
    def score_of_all(self) -> float | None:
        """The share of killed mutants among all that change behaviour, including equivalent mutants."""
        return self._killed_of(*CHANGING_STATUSES)

    def _killed_of(self, *statuses: MutantStatus) -> float | None:
        whole = self.count(*statuses)
        return self.count(MutantStatus.KILLED) / whole if whole else None

    @property
    def survivors(self) -> tuple[Mutant, ...]:
        """The mutants that pass in all worlds although they are not listed as equivalent."""
        return tuple(one.mutant for one in self.mutants if one.result.status is MutantStatus.SURVIVED)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences that explain why the score may be unreliable."""
        changing, equivalent = self.count(*CHANGING_STATUSES), self.count(MutantStatus.EQUIVALENT)
        found = []
        if changing < MIN_RELIABLE_MUTANTS:
            found.append(f"{self.task}: only {changing} mutants change behaviour")
        if equivalent > MAX_EQUIVALENT_SHARE * changing:
            share = f"more than {MAX_EQUIVALENT_SHARE:.0%}"
            found.append(f"{self.task}: {equivalent} of {changing} mutants are equivalent, {share}")
        return tuple(found)

    def data(self) -> dict[str, Any]:
        """Return the task's entry in scores.json."""
        return {
            "task": self.task,
            "worlds": self.worlds,
            "originals": len(self.right),
            "originals_judged_wrong": [
                {"original": original.name, "world": fault.world, "why": fault.why}
                for original, fault in self.wrong
            ],
            **{status.value.replace(" ", "_"): self.count(status) for status in MutantStatus},
            "score": self.score,
            "score_of_all": self.score_of_all,
        }
