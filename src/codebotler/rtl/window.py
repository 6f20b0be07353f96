"""The part of a trace that cuts leave, in English, for explanations."""

from __future__ import annotations

from typing import TYPE_CHECKING

from codebotler.rtl.semantics import Inconclusive, cut_at, find
from codebotler.rtl.wording import did, happened

if TYPE_CHECKING:
    from codebotler.core.trace import Trace
    from codebotler.rtl.formula import Cuts, Scope


class Window:
    """What cuts leave of a trace, and why.

    Args:
        cuts: applied in order.
        trace: what the robot did.

    Raises:
        Inconclusive: an option that is no text had to be compared.
    """

    def __init__(self, cuts: Cuts, trace: Trace) -> None:
        self.trace = trace
        self.span = (0, len(trace))
        self.made = []
        for one in cuts:
            at = find(one, trace, self.span)
            self.made.append((one, at))
            self.span = cut_at(one, at, self.span)

    def told(self) -> str:
        """Where it lies, such as ` after going to the lobby at step 1`; empty for the whole trace."""
        after, before = self._event("After"), self._event("Before")
        return " and".join(f" {bound}" for bound in (after, before) if bound)

    def told_after(self) -> str:
        """Where it begins, as the beginning of a sentence."""
        after = self._event("After")
        return f"{after}, " if after else ""

    def told_until(self) -> str:
        """Where it ends, as the end of a sentence."""
        before = self._event("Before")
        return f" {before}" if before else ""

    def duties(self) -> str:
        """When it is that something must not happen."""
        bounds = []
        for one, at in self.made:
            when = "after" if one.name.startswith("After") else "before"
            last = " for the last time" if one.name.endswith("Last") else ""
            if at is not None:
                bounds.append(f" {when} {did((one.element,), 'ing')}{last} (step {at + 1})")
            elif when == "before":
                came = "did not do in that time" if self._anywhere(one) else "never did"
                bounds.append(f" before {did((one.element,), 'ing')} (which it {came})")
        return " and".join(bounds)

    def never_began(self) -> str:
        """What should have begun it but never happened, as a verb; empty where there is no such thing."""
        for one, at in self.made:
            if at is None and one.name.startswith("After") and not self._anywhere(one):
                return f"never {did((one.element,), 'past', never=True)}"
        return ""

    def _anywhere(self, one: Scope) -> bool:
        try:
            return find(one, self.trace, (0, len(self.trace))) is not None
        except Inconclusive:
            return True

    def _event(self, side: str) -> str:
        found = [at for one, at in self.made if one.name.startswith(side) and at is not None]
        if not found:
            return ""
        return f"{side.lower()} {happened(self.trace[found[-1]], 'ing')} at step {found[-1] + 1}"
