"""Formats the rounds of a run: the effect and the cost of regenerating rejected programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.text import Text

from roboeval.cli.views.results import ruled

if TYPE_CHECKING:
    from roboeval.analysis.summary import EvaluationSummary


@dataclass(frozen=True)
class Round:
    """The result of one round of a run."""

    number: int  # the round; 0 is the first generation
    summary: EvaluationSummary  # results of all programs after the round
    requests: int  # programs requested in the round
    accepted: int  # programs that the check accepts after the round
    tokens: int  # tokens used in the round; 0 if the model does not count them


def rounds_view(rounds: Sequence[Round], *, repairs: bool) -> RenderableType:
    """Show the rounds of a run in a table with cumulative requests and tokens."""
    table = ruled("programs", "pass@1", "95% over tasks", "judged", "accepted", "requests", "tokens")
    requests = tokens = 0
    for one in rounds:
        requests, tokens = requests + one.requests, tokens + one.tokens
        [estimate] = one.summary.overall
        table.add_row(
            _name(one.number, repairs=repairs),
            f"{estimate.mean:.3f}",
            estimate.ends(),
            f"{one.summary.judged:,} of {one.summary.scope.total:,}",
            f"{one.accepted:,}",
            f"{requests:,}",
            f"{tokens:,}" if tokens else "unknown",
        )
    what = "repairing" if repairs else "regenerating"
    return Group(Text(), Text(f"The effect of {what} rejected programs", "bold"), Text(), table)


def _name(number: int, *, repairs: bool) -> str:
    if not number:
        return "the first ones"
    one, more = ("repair", "repairs") if repairs else ("retry", "retries")
    return f"after {number} {one if number == 1 else more}"
