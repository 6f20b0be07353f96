"""Decide whether a failed mission may be continued without a person, and within which contract."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from codebotler.core.skills.declaration import by_event
from codebotler.core.trace import Trace
from codebotler.missions.log import SKILL_END_EVENTS, LogLine, MissionState
from codebotler.missions.past import MissionPast
from codebotler.missions.view import SessionView
from codebotler.simulator.contract import Contract


@dataclass(frozen=True)
class PriorApproval:
    """What a person approved, for the rest of a mission.

    Args:
        contract: what the approved program may do at most.
        done_before: how many steps its past had when it was approved.
    """

    contract: Contract
    done_before: int = 0

    @classmethod
    def of(cls, view: SessionView) -> PriorApproval | None:
        """Return what the approval of a session's program allows, or None if that is unknown."""
        before = 0 if view.past is None else len(view.past.trace)
        return None if view.contract is None else cls(view.contract, before)

    def allows(self, view: SessionView, past: MissionPast) -> bool:
        """Whether the program for the rest, of which a session has a view, needs no further approval."""
        if view.contract is None or view.problems:
            return False
        return not view.contract.beyond(self.contract_after(past.trace)).skills

    def contract_after(self, trace: Trace) -> Contract:
        """Return what is left of the contract after a trace."""
        rows = (by_event(event.kind) for event in trace[self.done_before :])
        done = Counter(row.name for row in rows if row is not None)
        return Contract(
            {
                name: bound
                if bound.at_most is None
                else replace(bound, at_most=max(0, bound.at_most - done[name]))
                for name, bound in self.contract.skills.items()
            }
        )


def is_recoverable(view: SessionView, events: Sequence[LogLine]) -> bool:
    """Whether a mission failed because a skill did, so that a model may be asked for the rest."""
    ends = [line for line in events if line["event"] in SKILL_END_EVENTS]
    failed = bool(ends) and ends[-1]["event"] == "error" and view.reason.startswith(f"{ends[-1]['kind']}: ")
    return failed and view.state is MissionState.FAILED and bool(view.instruction)
