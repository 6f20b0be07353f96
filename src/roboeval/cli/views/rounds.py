"""A table of the rounds of a run: what requesting rejected programs again brings, and what it costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.text import Text

from roboeval.analysis.metrics import judged_count
from roboeval.cli.views.results import ruled

if TYPE_CHECKING:
    from roboeval.analysis.summary import EvaluationSummary


@dataclass(frozen=True)
class Round:
    """How a round of a run did.

    Args:
        number: from 0, for the first programs.
        summary: the verdicts on all programs after it.
        requests: how many programs were requested in it.
        accepted: how many programs the check accepts after it.
        tokens: the tokens of its requests, as far as the model counts them.
    """

    number: int
    summary: EvaluationSummary
    requests: int
    accepted: int
    tokens: int


def rounds_view(rounds: Sequence[Round], *, repairs: bool) -> RenderableType:
    """The rounds of a run, one or more, in a table; numbers of tokens are those up to then."""
    table = ruled("programs", "pass@1", "95% over tasks", "judged", "accepted", "requests", "tokens")
    requests = tokens = 0
    for one in rounds:
        requests, tokens = requests + one.requests, tokens + one.tokens
        judged, [estimate] = judged_count(one.summary.prompts), one.summary.overall
        table.add_row(
            _name(one.number, repairs=repairs),
            f"{estimate.mean:.3f}",
            estimate.ends(),
            f"{judged:,} of {one.summary.scope.total:,}",
            f"{one.accepted:,}",
            f"{requests:,}",
            f"{tokens:,}" if tokens else "unknown",
        )
    what = "repairing" if repairs else "requesting again"
    return Group(Text(), Text(f"The effect of {what} what the check rejects", "bold"), Text(), table)


def _name(number: int, *, repairs: bool) -> str:
    if not number:
        return "the first ones"
    one, more = ("repair", "repairs") if repairs else ("retry", "retries")
    return f"after {number} {one if number == 1 else more}"
