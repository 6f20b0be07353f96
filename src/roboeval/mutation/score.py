"""What became of the mutants of a task, and its mutation score."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

from roboeval.mutation.mutants import Mutant, Original

ENOUGH = 60
"""How many mutants that change behaviour a task needs for its score to mean something."""
MOST_EQUIVALENT = 0.15
"""The largest share of a task's mutants that should be equivalent."""


class MutantStatus(StrEnum):
    """What became of a mutant."""

    KILLED = "killed"
    SURVIVED = "survived"
    EQUIVALENT = "equivalent"
    SAME = "same traces"
    CRASHES = "crashes everywhere"


CHANGED = MutantStatus.KILLED, MutantStatus.SURVIVED, MutantStatus.EQUIVALENT
"""Those of mutants that do something else than their original, and do something at all."""


class Result(NamedTuple):
    """What became of a program, and where.

    Args:
        status: of the mutant.
        world: what the world is about in which it was killed.
        why: the check that failed there, or the error; for an equivalent mutant the reason.
    """

    status: MutantStatus
    world: str | None = None
    why: str | None = None


class TriedMutant(NamedTuple):
    """A mutant and what became of it."""

    mutant: Mutant
    result: Result

    def row(self) -> dict[str, Any]:
        """As a row of mutants.jsonl."""
        return {
            "operator": self.mutant.operator,
            "original": self.mutant.original.name,
            **self.result._asdict(),
            "diff": self.mutant.diff,
            "program": self.mutant.program,
        }


@dataclass(frozen=True)
class MutationScore:
    """How many mutants of a task the checks kill.

    Args:
        task: its name.
        worlds: how many worlds each mutant was tried in.
        right: the originals of which mutants were made.
        wrong: the originals that the suite finds wrong, and where.
        mutants: all that were tried.
    """

    task: str
    worlds: int
    right: tuple[Original, ...]
    wrong: tuple[tuple[Original, Result], ...]
    mutants: tuple[TriedMutant, ...]

    def count(self, *statuses: MutantStatus) -> int:
        """How many mutants have one of some statuses."""
        return sum(one.result.status in statuses for one in self.mutants)

    @property
    def score(self) -> float | None:
        """The share of wrong mutants that are killed: equivalent ones are left out."""
        return self._killed_of(MutantStatus.KILLED, MutantStatus.SURVIVED)

    @property
    def score_of_all(self) -> float | None:
        """The share of killed mutants among all that change behaviour, also equivalent ones."""
        return self._killed_of(*CHANGED)

    def _killed_of(self, *statuses: MutantStatus) -> float | None:
        whole = self.count(*statuses)
        return self.count(MutantStatus.KILLED) / whole if whole else None

    @property
    def survivors(self) -> tuple[Mutant, ...]:
        """The mutants that the checks let through, and that nobody has explained."""
        return tuple(one.mutant for one in self.mutants if one.result.status is MutantStatus.SURVIVED)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes the score doubtful, in sentences."""
        changing, equivalent = self.count(*CHANGED), self.count(MutantStatus.EQUIVALENT)
        found = []
        if changing < ENOUGH:
            found.append(f"{self.task}: only {changing} mutants do something else than their original")
        if equivalent > MOST_EQUIVALENT * changing:
            share = f"more than {MOST_EQUIVALENT:.0%}"
            found.append(f"{self.task}: {equivalent} of {changing} mutants are equivalent, {share}")
        return tuple(found)

    def data(self) -> dict[str, Any]:
        """The numbers, for machines."""
        return {
            "task": self.task,
            "worlds": self.worlds,
            "originals": len(self.right),
            "originals_judged_wrong": [
                {"original": original.name, "world": fault.world, "why": fault.why}
                for original, fault in self.wrong
            ],
            **{status.name.lower(): self.count(status) for status in MutantStatus},
            "score": self.score,
            "score_of_all": self.score_of_all,
        }
