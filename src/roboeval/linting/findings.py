"""Defines the findings of the linter, and formats them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from codebotler.core.text.words import counted

FindingKind = Literal[
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
    """A likely mistake in a task. The task file may accept it with a reason."""

    kind: FindingKind
    subject: str  # identifies the finding among those of its kind
    message: str
    path: Path
    line: int | None
    accepted: str | None = None  # why the finding is intended, or None if it is not accepted

    @property
    def name(self) -> str:
        """The name under which a task file accepts the finding, such as `implied: comes_back`."""
        return f"{self.kind}: {self.subject}"

    def rendered(self) -> str:
        """Format the finding as a line of text. Its path is relative to the current folder, if possible."""
        here = Path.cwd()
        path = self.path.relative_to(here) if self.path.is_relative_to(here) else self.path
        what, why = ("warning", "") if self.accepted is None else ("accepted", f": {self.accepted}")
        return f"{path}:{self.line or 1}: {what}: {self.message} [{self.name}]{why}"


def render(findings: Iterable[Finding], *, accepted: bool = False) -> str:
    """Format findings as lines. If `accepted`, list accepted ones with their reasons, else count them."""
    every = [*findings]
    lines = [one.rendered() for one in every if accepted or one.accepted is None]
    if hidden := len(every) - len(lines):
        lines.append(f"{counted(hidden, 'accepted finding')} not shown; use --accepted to list")
    return "\n".join(lines) or "no findings"
