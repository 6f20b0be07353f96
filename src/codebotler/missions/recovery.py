"""Decide whether a failed mission may be continued without a person, and what to ask a person otherwise."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from codebotler.core.skills.declaration import by_event
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import shortened
from codebotler.core.trace import Trace
from codebotler.missions.display.view import SessionView
from codebotler.missions.preflight import ask_rooms, is_resumable
from codebotler.missions.session import MissionSession
from codebotler.missions.stop import StopButton
from codebotler.missions.storage.log import SKILL_END_EVENTS, LogLine, MissionState
from codebotler.missions.storage.past import MissionPast, read_past
from codebotler.missions.storage.store import find_mission
from codebotler.robots.base import NotReadyError, Robot
from codebotler.robots.reservation import Reservation
from codebotler.simulator.guard.contract import Contract


@dataclass(frozen=True)
class PriorApproval:
    """The approval of a mission's program, which may also cover a program that continues the mission.

    Args:
        mission: the ID of the approved mission.
        contract: what the approved program may do at most.
        done_before: how many steps earlier missions had done when the program was approved.
    """

    mission: str
    contract: Contract
    done_before: int = 0

    @classmethod
    def of(cls, view: SessionView) -> PriorApproval | None:
        """Return the approval of the program in a session's view, or None if the program was not checked."""
        before = 0 if view.past is None else len(view.past.trace)
        return None if view.contract is None else cls(view.id, view.contract, before)

    def allows(self, view: SessionView, past: MissionPast) -> bool:
        """Whether the program in `view`, which continues `past`, does only what the contract still allows."""
        if view.contract is None or view.problems:
            return False
        return not view.contract.excess_over(self.contract_after(past.trace)).skills

    def contract_after(self, trace: Trace) -> Contract:
        """Return what the contract still allows after `trace`: if 1 of 3 `pick` calls is done, 2 are left."""
        rows = (by_event(event.kind) for event in trace[self.done_before :] if not event.failed)
        done = Counter(row.name for row in rows if row is not None)
        left = {**self.contract.skills}
        for name, bound in self.contract.skills.items():
            if bound.at_most is not None:
                left[name] = replace(bound, at_most=max(0, bound.at_most - done[name]))
        return Contract(left)


def is_recoverable(view: SessionView, events: Sequence[LogLine], skills: SkillTable) -> bool:
    """Whether a mission failed because a skill failed, so that a model may write a program for the rest.

    False if the mission called a skill that leaves no record, as the new program might repeat it unnoticed.
    """
    ends = [line for line in events if line["event"] in SKILL_END_EVENTS]
    failed = bool(ends) and ends[-1]["event"] == "error" and view.reason.startswith(f"{ends[-1]['kind']}: ")
    called = (skills[line["skill"]] for line in ends)
    is_traced = all(row.is_idle or row.recording is not None for row in called)
    return failed and is_traced and view.state is MissionState.FAILED and bool(view.instruction)


def past_to_recover(session: MissionSession, robot: Robot, home: Path) -> MissionPast | None:
    """Wait until a session ends. Return its past if a model may continue the mission, otherwise None."""
    session.join()
    if not is_recoverable(session.view, session.events(), robot.skills):
        return None
    return read_past(find_mission(home, session.view.id), robot.skills, robot.name)


def ask_evidence(
    robot: Robot, home: Path, past: MissionPast, remark: Callable[[str], None], stop_button: StopButton
) -> list[str]:
    """Return sentences that help a person to decide whether the step `past.unsure` happened.

    Connect a real robot and ask where it is. If this fails, for example because the robot is in use or
    `stop_button` was pressed, pass a sentence that says why to `remark`.
    """
    before = [past.last_position_text] if past.last_position_text else []
    if is_resumable(robot):  # it knows no more than the log
        return [*before, "A simulated robot cannot say, so your answer decides what it goes on with."]
    try:
        attach = partial(stop_button.attach, robot)
        with Reservation(robot, home, attach):
            attach()  # again, since a press may have come before the robot was connected
            place = ask_rooms(robot, remark)[1]
    except (NotReadyError, OSError) as error:
        remark(str(error))
        place = ""
    where = f'says that it is in "{shortened(place)}"' if place else "does not say where it is"
    return [*before, f"Now, the robot {where}."]
