"""Defines the status of mutants and the mutation score of a task."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

from roboeval.mutation.mutants import Mutant, Original

MIN_RELIABLE_MUTANTS = 60  # a score from fewer mutants that change behaviour is unreliable
MAX_EQUIVALENT_SHARE = 0.15  # largest share of equivalent mutants for which the score is reliable


class MutantStatus(StrEnum):
    """The status of a mutant: rejected by the checks (killed), not rejected (survived), or not counted."""

    KILLED = "killed"
    SURVIVED = "survived"
    EQUIVALENT = "equivalent"
    SAME = "same traces"
    CRASHES = "crashes"


CHANGING_STATUSES = MutantStatus.KILLED, MutantStatus.SURVIVED, MutantStatus.EQUIVALENT


class MutantResult(NamedTuple):
    """The status of a mutant, with the world and the reason that decided it."""

    status: MutantStatus
    world: str | None = None  # the world in which it was killed
    why: str | None = None  # the failed check, the error, or why the mutant is equivalent


class TriedMutant(NamedTuple):
    """A mutant, and the result of running it in the worlds of its task."""

    mutant: Mutant
    result: MutantResult

    def row(self) -> dict[str, Any]:
        """Return the mutant and its result as JSON data, for a line of mutants/TASK.jsonl."""
        return {
            "operator": self.mutant.operator,
            "original": self.mutant.original.name,
            **self.result._asdict(),
            "diff": self.mutant.diff,
            "program": self.mutant.program,
        }


@dataclass(frozen=True)
class MutationScore:
    """The mutants of a task with their results, and the mutation score computed from them."""

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
        """The share of killed mutants among those that were killed or survived, or None if there are none."""
        return self._killed_of(MutantStatus.KILLED, MutantStatus.SURVIVED)

    @property
    def score_of_all(self) -> float | None:
        """Like `score`, but mutants listed as equivalent also count, as if they had survived."""
        return self._killed_of(*CHANGING_STATUSES)

    def _killed_of(self, *statuses: MutantStatus) -> float | None:
        whole = self.count(*statuses)
        return self.count(MutantStatus.KILLED) / whole if whole else None

    @property
    def survivors(self) -> tuple[Mutant, ...]:
        """The mutants that pass in all worlds, change behaviour, and are not listed as equivalent."""
        return tuple(one.mutant for one in self.mutants if one.result.status is MutantStatus.SURVIVED)

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each reason why the score may be unreliable, such as too few mutants."""
        changing, equivalent = self.count(*CHANGING_STATUSES), self.count(MutantStatus.EQUIVALENT)
        found = []
        if changing < MIN_RELIABLE_MUTANTS:
            few = f"only {changing} mutants change behaviour, but a reliable score needs"
            found.append(f"{self.task}: {few} {MIN_RELIABLE_MUTANTS}; add correct programs")
        if equivalent > MAX_EQUIVALENT_SHARE * changing:
            share = f"more than {MAX_EQUIVALENT_SHARE:.0%}, so the score is unreliable"
            found.append(f"{self.task}: {equivalent} of {changing} mutants are equivalent, {share}")
        return tuple(found)

    def data(self) -> dict[str, Any]:
        """Return the task's entry in scores.json: its score, its counts, and the originals judged wrong."""
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
