"""Further rounds of a run, in which rejected programs are requested again or repaired (paper, section VI).

Each round is a run in a folder of its own: it takes over the programs that the check accepts, and requests
the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from codebotler.prompts import Prompt
from roboeval.evaluation.requests import GenerationPlan
from roboeval.evaluation.runs.completions import Completion, CompletionKey
from roboeval.evaluation.runs.folder import RunFolder

ROUND = "round"  # the column of rows: in which round a program was written; absent in those of the first
SAMPLE_STRIDE = 1_000_000
"""The distance between the numbers of samples of two rounds, so that each has a seed of its own."""


@dataclass(frozen=True, kw_only=True)
class RoundPlan(GenerationPlan):
    """The completions of a round after the first.

    Args:
        number: the round, at least 1; the first programs were written in round 0.
        repairs: whether the model sees the rejected program and its problems.
        earlier: the completions of the round before.
        problems: the problems of each rejected program, by its key.
    """

    number: int
    repairs: bool
    earlier: Mapping[CompletionKey, Completion] = field(repr=False)
    problems: Mapping[CompletionKey, Sequence[str]] = field(repr=False)

    def prompt(self, key: CompletionKey) -> Prompt:
        """The request for a completion; without a program there is nothing to repair."""
        first, program = super().prompt(key), self.earlier[key].program
        return first.after(program, self.problems[key]) if self.repairs and program.strip() else first

    def sample(self, key: CompletionKey) -> int:
        """The number of the sample, from which its seed comes."""
        return key[2] + self.number * SAMPLE_STRIDE

    def given(self) -> Iterator[Completion]:
        """The completions that are taken over, since the check accepted them."""
        return (one for key, one in self.earlier.items() if key not in self.problems)

    def mark(self) -> Mapping[str, int]:
        """What the rows of this round say of it."""
        return {ROUND: self.number}

    def folder(self, run: RunFolder) -> RunFolder:
        """The run of this round, beside the first one's files."""
        return RunFolder(run.path / f"{'repair' if self.repairs else 'retry'}-{self.number}")


def round_of(completion: Completion) -> int:
    """In which round a program was written, from 0."""
    number = completion.more.get(ROUND, 0)
    return number if type(number) is int else 0
