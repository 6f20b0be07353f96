"""Findings of the linter, and their text."""

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
    "uncovered",
    "untripped",
    "dead-regex",
    "slow-regex",
    "unworded",
    "absent",
    "same-worlds",
    "stale-acceptance",
]


@dataclass(frozen=True)
class Finding:
    """Something about a task that is likely to be a mistake."""

    kind: Kind
    subject: str  # stays the same as long as the mistake does
    message: str
    path: Path
    line: int | None
    accepted: str | None = None  # why it is there on purpose; None where it is open

    @property
    def name(self) -> str:
        """The name by which a task file accepts it, such as `implied: comes_back`."""
        return f"{self.kind}: {self.subject}"

    def rendered(self) -> str:
        """One line of text, with the path relative to the current folder."""
        here = Path.cwd()
        path = self.path.relative_to(here) if self.path.is_relative_to(here) else self.path
        what, why = ("warning", "") if self.accepted is None else ("accepted", f": {self.accepted}")
        return f"{path}:{self.line or 1}: {what}: {self.message} [{self.name}]{why}"


def render(findings: Iterable[Finding], *, accepted: bool = False) -> str:
    """Findings as lines of text; accepted ones are shown with their reasons, or only counted."""
    every = [*findings]
    lines = [one.rendered() for one in every if accepted or one.accepted is None]
    if hidden := len(every) - len(lines):
        number = "1 finding" if hidden == 1 else f"{hidden} findings"
        more = f"{number} more {'is' if hidden == 1 else 'are'} accepted by the task files"
        none = f"nothing was found but {number} that the task files accept"
        lines.append(f"{more if lines else none}; --accepted tells why")
    return "\n".join(lines) or "nothing was found"
