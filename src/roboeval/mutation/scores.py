"""The mutation score of a task, and what became of every mutant."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from codebotler.simulator.rules import Rules
from roboeval.mutation.mutants import Mutant, Original
from roboeval.mutation.stillright import MOST, Reasons, key_of
from roboeval.mutation.survival import CHANGED, Baseline, End, Fate
from roboeval.suites.load import Scenario

ENOUGH = 60
"""How many mutants that change behaviour a task needs for its score to mean something."""


@dataclass(frozen=True)
class Job:
    """What is to be tried for a task.

    Args:
        task: its name.
        phrasings: of its instruction.
        programs: of which the right ones are mutated.
        scenarios: worlds with what they require.
        rules: how worlds are simulated.
        still_right: which mutants are right all the same.
        most: how many mutants to try at most.
        seed: from which they are drawn.
    """

    task: str
    phrasings: Sequence[str]
    programs: Sequence[Original]
    scenarios: Sequence[Scenario]
    rules: Rules
    still_right: Reasons
    most: int
    seed: int


@dataclass(frozen=True)
class Trial:
    """A mutant and what became of it."""

    mutant: Mutant
    end: End

    def data(self) -> dict[str, Any]:
        """As a row of mutants.jsonl."""
        return {
            "operator": self.mutant.operator,
            "original": self.mutant.original.name,
            "fate": str(self.end.fate),
            "world": self.end.world,
            "why": self.end.why,
            "diff": self.mutant.diff,
            "program": self.mutant.program,
        }


@dataclass(frozen=True)
class Score:
    """How many mutants of a task the checks find wrong.

    Args:
        task: its name.
        worlds: how many worlds each mutant was tried in.
        right: the originals of which mutants were made.
        wrong: the originals that the suite finds wrong, of which none were made.
        trials: the mutants.
    """

    task: str
    worlds: int
    right: tuple[Original, ...]
    wrong: tuple[Baseline, ...]
    trials: tuple[Trial, ...]

    def count(self, *fates: Fate) -> int:
        """How many mutants have one of some fates."""
        return sum(trial.end.fate in fates for trial in self.trials)

    @property
    def score(self) -> float | None:
        """The share of wrong mutants that are killed: those that are still right are left out."""
        return _share(self.count(Fate.KILLED), self.count(Fate.KILLED, Fate.SURVIVED))

    @property
    def score_of_all(self) -> float | None:
        """The share of killed mutants among all that change behaviour, also those that are still right."""
        return _share(self.count(Fate.KILLED), self.count(*CHANGED))

    @property
    def survivors(self) -> tuple[Trial, ...]:
        """The mutants that the checks let through, and that nobody has explained."""
        return tuple(trial for trial in self.trials if trial.end.fate is Fate.SURVIVED)

    @property
    def complaints(self) -> tuple[str, ...]:
        """What makes the score doubtful, in sentences."""
        changing, right = self.count(*CHANGED), self.count(Fate.STILL_RIGHT)
        said = []
        if changing < ENOUGH:
            said.append(f"{self.task}: only {changing} mutants do something else than their original")
        if right > MOST * changing:
            said.append(f"{self.task}: {right} of {changing} mutants are still right, more than {MOST:.0%}")
        return tuple(said)

    def data(self) -> dict[str, Any]:
        """The numbers, for machines."""
        return {
            "task": self.task,
            "worlds": self.worlds,
            "originals": len(self.right),
            "originals_judged_wrong": [
                {"original": one.original.name, "world": one.fault.world, "why": one.fault.why}
                for one in self.wrong
                if one.fault is not None
            ],
            **{fate.name.lower(): self.count(fate) for fate in Fate},
            "score": self.score,
            "score_of_all": self.score_of_all,
        }


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def explained(trials: Iterable[Trial], why: Reasons) -> tuple[Trial, ...]:
    """The trials, where survivors that stand on the list of those that are still right have that fate."""
    return tuple(
        Trial(one.mutant, End(Fate.STILL_RIGHT, why=why[key]))
        if one.end.fate is Fate.SURVIVED and (key := key_of(one.mutant)) in why
        else one
        for one in trials
    )


def by_operator(scores: Sequence[Score]) -> dict[str, Counter[Fate]]:
    """What became of the mutants of each operator, in all tasks together."""
    counts: dict[str, Counter[Fate]] = {}
    for score in scores:
        for trial in score.trials:
            counts.setdefault(trial.mutant.operator, Counter())[trial.end.fate] += 1
    return counts
