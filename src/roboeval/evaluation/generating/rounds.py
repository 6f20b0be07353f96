"""Plans further rounds of a run, which regenerate or repair rejected programs (paper, section VI).

Each round is a run in its own folder. It copies the programs that the check accepts and requests new
versions of the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from codebotler.prompts import Prompt
from roboeval.evaluation.generating.requests import GenerationPlan
from roboeval.evaluation.runs.completions import Completion, CompletionKey
from roboeval.evaluation.runs.folder import RunFolder

SAMPLE_STRIDE = 1_000_000  # offset of sample numbers between rounds, so that all seeds differ


@dataclass(frozen=True, kw_only=True)
class RoundPlan(GenerationPlan):
    """Plans the completions of a round after the first.

    Args:
        number: the round, from 1; round 0 wrote the first programs.
        repairs: whether the model sees the rejected program and its problems.
        earlier: the completions of the previous round.
        problems: the problems of each rejected program, by completion key.
    """

    number: int
    repairs: bool
    earlier: Mapping[CompletionKey, Completion] = field(repr=False)
    problems: Mapping[CompletionKey, Sequence[str]] = field(repr=False)

    def prompt(self, key: CompletionKey) -> Prompt:
        """Return the prompt for a completion. For a repair, it includes the rejected program."""
        first, program = super().prompt(key), self.earlier[key].program
        return first.after(program, self.problems[key]) if self.repairs and program.strip() else first

    def sample(self, key: CompletionKey) -> int:
        """Return the number of the sample, which determines its random seed."""
        return key[2] + self.number * SAMPLE_STRIDE

    def given(self) -> Iterator[Completion]:
        """Return the completions of the previous round that the check accepted."""
        return (one for key, one in self.earlier.items() if key not in self.problems)

    def folder(self, run: RunFolder) -> RunFolder:
        """Return the run of this round, a subfolder of the first run."""
        return RunFolder(run.path / f"{'repair' if self.repairs else 'retry'}-{self.number}")
