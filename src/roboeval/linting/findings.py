"""What the linter finds in tasks, and as which text it is shown."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Kind = Literal[
    "unsatisfiable",
    "implied",
    "undecided",
    "unused",
    "misjudged",
    "unsaid",
    "untripped",
    "dead-regex",
    "slow-regex",
    "absent",
    "same-worlds",
    "stale-acceptance",
]


@dataclass(frozen=True)
class Finding:
    """Something about a task that is likely to be a mistake.

    Args:
        kind: what sort of mistake.
        subject: what has it, in words that stay the same while the mistake does.
        message: one sentence.
        path: the task file.
        line: where in it, counted from 1.
        accepted: why it is there on purpose, as the task file says; None where it is open.
    """

    kind: Kind
    subject: str
    message: str
    path: Path
    line: int | None
    accepted: str | None = None

    @property
    def name(self) -> str:
        """By which a task file accepts it, such as `implied: comes_back`."""
        return f"{self.kind}: {self.subject}"

    def rendered(self) -> str:
        """One line of text, with the path as seen from the current folder."""
        here = Path.cwd()
        path = self.path.relative_to(here) if self.path.is_relative_to(here) else self.path
        what, why = ("warning", "") if self.accepted is None else ("accepted", f": {self.accepted}")
        return f"{path}:{self.line or 1}: {what}: {self.message} [{self.name}]{why}"


def render(findings: Iterable[Finding], *, accepted: bool = False) -> str:
    """Findings as lines of text.

    Args:
        findings: what was found.
        accepted: whether to show the accepted ones, with their reasons, instead of only counting them.
    """
    every = [*findings]
    lines = [one.rendered() for one in every if accepted or one.accepted is None]
    if hidden := len(every) - len(lines):
        number = "1 finding" if hidden == 1 else f"{hidden} findings"
        more = f"{number} more {'is' if hidden == 1 else 'are'} accepted by the task files"
        none = f"nothing was found but {number} that the task files accept"
        lines.append(f"{more if lines else none}; --accepted tells why")
    return "\n".join(lines) or "nothing was found"
